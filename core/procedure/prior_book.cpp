#include "core/procedure/prior_book.hpp"

#include "core/localize/first_guess.hpp"

namespace anchord::procedure {
namespace {

constexpr std::size_t k_most = 2000;

}  // namespace

void PriorBook::turned(NetworkId anchor, double heading_rad, double rss_dbm) {
  auto& samples = priors_[anchor].turn;
  if (samples.size() < k_most) samples.push_back({heading_rad, rss_dbm});
}

void PriorBook::climbed(NetworkId anchor, double height_m, double rss_dbm) {
  auto& samples = priors_[anchor].heights;
  if (samples.size() < k_most) samples.push_back({height_m, rss_dbm});
}

void PriorBook::ranged(NetworkId anchor, const Eigen::Vector3d& tag_m, double distance_m) {
  newest_[anchor] = {tag_m, distance_m};
}

void PriorBook::begin_turn() {
  for (auto& [anchor, priors] : priors_) priors.turn.clear();
}

void PriorBook::begin_height_search() {
  for (auto& [anchor, priors] : priors_) priors.heights.clear();
}

void PriorBook::conclude_turn() {
  ++version_;
  for (auto& [anchor, priors] : priors_) {
    if (const auto bearing = bearing_from_turn(priors.turn)) {
      priors.bearing = bearing.value();
      if (const auto seen = newest_.find(anchor); seen != newest_.end())
        priors.turned_at_m = seen->second.tag_m;
    }
    guess(anchor, priors);
  }
}

void PriorBook::conclude_height_search() {
  ++version_;
  for (auto& [anchor, priors] : priors_) {
    const auto seen = newest_.find(anchor);
    const bool ranged = seen != newest_.end();
    if (const auto height = height_from_search(
            priors.heights, ranged ? std::optional(seen->second.distance_m) : std::nullopt)) {
      priors.height = height.value();
      if (ranged) priors.climbed_at_m = seen->second.tag_m;
    }
    guess(anchor, priors);
  }
}

std::optional<bool> PriorBook::lobe_seen(NetworkId anchor) const {
  constexpr double k_noise = 0.1;  ///< from there on the bearing's sigma is at its widest
  const auto it = priors_.find(anchor);
  if (it == priors_.end()) return std::nullopt;
  const auto bearing = bearing_from_turn(it->second.turn);
  return bearing ? std::optional(bearing.value().confidence > k_noise) : std::nullopt;
}

void PriorBook::guess(NetworkId anchor, Priors& priors) {
  const auto seen = newest_.find(anchor);
  if (!priors.bearing || seen == newest_.end()) return;
  priors.guess_m =
      first_guess(seen->second.tag_m, seen->second.distance_m, priors.bearing->bearing_rad,
                  priors.height && !priors.height->too_narrow ? priors.height->height_m : default_height_m_);
}

std::optional<Eigen::Vector3d> PriorBook::guess_m(NetworkId anchor) const {
  const auto it = priors_.find(anchor);
  return it == priors_.end() ? std::nullopt : it->second.guess_m;
}

}  // namespace anchord::procedure
