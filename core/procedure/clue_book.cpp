#include "core/procedure/clue_book.hpp"

#include "core/localize/first_guess.hpp"

namespace anchord::procedure {
namespace {

constexpr std::size_t k_most = 2000;

}  // namespace

void ClueBook::turned(NetworkId anchor, double heading_rad, double rss_dbm) {
  auto& samples = clues_[anchor].turn;
  if (samples.size() < k_most) samples.push_back({heading_rad, rss_dbm});
}

void ClueBook::climbed(NetworkId anchor, double height_m, double rss_dbm) {
  auto& samples = clues_[anchor].heights;
  if (samples.size() < k_most) samples.push_back({height_m, rss_dbm});
}

void ClueBook::ranged(NetworkId anchor, const Eigen::Vector3d& tag_m, double distance_m) {
  newest_[anchor] = {tag_m, distance_m};
}

void ClueBook::begin_turn() {
  for (auto& [anchor, clues] : clues_) clues.turn.clear();
}

void ClueBook::begin_height_search() {
  for (auto& [anchor, clues] : clues_) clues.heights.clear();
}

void ClueBook::conclude_turn() {
  ++version_;
  for (auto& [anchor, clues] : clues_) {
    if (const auto bearing = bearing_from_turn(clues.turn)) {
      clues.bearing = bearing.value();
      if (const auto seen = newest_.find(anchor); seen != newest_.end())
        clues.turned_at_m = seen->second.tag_m;
    }
    guess(anchor, clues);
  }
}

void ClueBook::conclude_height_search() {
  ++version_;
  for (auto& [anchor, clues] : clues_) {
    if (const auto height = height_from_search(clues.heights)) {
      clues.height = height.value();
      if (const auto seen = newest_.find(anchor); seen != newest_.end())
        clues.climbed_at_m = seen->second.tag_m;
    }
    guess(anchor, clues);
  }
}

std::optional<bool> ClueBook::lobe_seen(NetworkId anchor) const {
  constexpr double k_noise = 0.1;  ///< from there on the bearing's sigma is at its widest
  const auto it = clues_.find(anchor);
  if (it == clues_.end()) return std::nullopt;
  const auto bearing = bearing_from_turn(it->second.turn);
  return bearing ? std::optional(bearing.value().confidence > k_noise) : std::nullopt;
}

void ClueBook::guess(NetworkId anchor, Clues& clues) {
  const auto seen = newest_.find(anchor);
  if (!clues.bearing || seen == newest_.end()) return;
  clues.guess_m = first_guess(seen->second.tag_m, seen->second.distance_m, clues.bearing->bearing_rad,
                              clues.height ? clues.height->height_m : default_height_m_);
}

std::optional<Eigen::Vector3d> ClueBook::guess_m(NetworkId anchor) const {
  const auto it = clues_.find(anchor);
  return it == clues_.end() ? std::nullopt : it->second.guess_m;
}

}  // namespace anchord::procedure
