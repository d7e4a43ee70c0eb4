#include "core/geo/track_segments.hpp"

#include <algorithm>
#include <cmath>

namespace anchord {
namespace {

constexpr double k_recent_s = 2.0;         ///< beyond, a velocity says nothing about where to
constexpr double k_velocity_over_s = 0.2;  ///< shorter, and the noise of two positions is the velocity
constexpr double k_floor_m = 0.3;  ///< of every allowance: lever arms swing, interpolated logs stumble
constexpr double k_sigmas = 4.0;
constexpr std::size_t k_most_recent = 256, k_most_open = 24;
constexpr double k_most_support = 20;

}  // namespace

std::optional<TrackSegments::Velocity> TrackSegments::velocity(const Piece& piece) const {
  const Place& last = piece.recent.back();
  const Place* from = nullptr;
  for (auto it = std::next(piece.recent.rbegin()); it != piece.recent.rend(); ++it) {
    if (last.t_s - it->t_s >= k_recent_s) break;
    from = &*it;
    if (last.t_s - it->t_s >= k_velocity_over_s) break;
  }
  if (from == nullptr || !(last.t_s > from->t_s)) return std::nullopt;
  const double over_s = last.t_s - from->t_s;
  return Velocity{over_s, (last.at_m - from->at_m) / over_s};
}

/// Minus twice a log likelihood up to a constant; nothing where the piece cannot reach the place.
std::optional<double> TrackSegments::cost(const Piece& piece, const Place& place) const {
  const Place& last = piece.recent.back();
  const double dt_s = place.t_s - last.t_s;
  if (dt_s > limits_.max_pause_s) return std::nullopt;
  const double noise_m = k_floor_m + k_sigmas * std::hypot(place.sigma_m, last.sigma_m);
  double off_m = (place.at_m - last.at_m).norm();
  double allowed_m = limits_.max_speed_mps * dt_s + noise_m;
  if (off_m > allowed_m) return std::nullopt;
  if (dt_s < k_recent_s) {
    const auto own = velocity(piece);
    if (const auto& v = own ? own : piece.inherited) {
      const double led_off_m = (place.at_m - last.at_m - v->mps * dt_s).norm();
      const double led_m =
          limits_.max_acceleration_mps2 * dt_s * (dt_s + v->over_s) / 2 + noise_m * (1 + dt_s / v->over_s);
      if (own && led_off_m > led_m) return std::nullopt;
      if (led_off_m <= led_m && led_m < allowed_m) {
        off_m = led_off_m;
        allowed_m = led_m;
      }
    }
  }
  const auto support = static_cast<double>(
      std::ranges::count_if(piece.recent, [&](const Place& p) { return place.t_s - p.t_s <= k_recent_s; }));
  const double deviation = 3 * off_m / allowed_m;  // what is allowed is three sigma
  return deviation * deviation + 6 * std::log(allowed_m) -
         2 * std::log(std::clamp(support, 0.5, k_most_support));
}

std::size_t TrackSegments::begin(const Place& place) {
  const Piece* left = nullptr;
  for (const std::size_t index : open_) {
    const Piece& piece = pieces_[index];
    if (place.t_s - piece.told.last_s >= k_recent_s || piece.told.n < 2) continue;
    if (left == nullptr || piece.told.n > left->told.n) left = &piece;
  }
  Piece fresh{{1, place.t_s, place.t_s}, {place}, left != nullptr ? velocity(*left) : std::nullopt};
  pieces_.push_back(std::move(fresh));
  if (open_.size() >= k_most_open) {
    // Of many outliers the least supported, oldest piece is not looked at again.
    const auto least = std::ranges::min_element(
        open_, {}, [&](std::size_t i) { return std::pair(pieces_[i].told.n, pieces_[i].told.last_s); });
    open_.erase(least);
  }
  open_.push_back(pieces_.size() - 1);
  return pieces_.size() - 1;
}

std::size_t TrackSegments::add(double t_s, const Eigen::Vector3d& at_m, double sigma_m) {
  const Place place{t_s, at_m, sigma_m};
  std::optional<double> least;
  std::size_t best = 0;
  for (const std::size_t index : open_) {
    const auto c = cost(pieces_[index], place);
    if (c && (!least || *c < *least)) {
      least = c;
      best = index;
    }
  }
  if (!least) return begin(place);
  Piece& piece = pieces_[best];
  ++piece.told.n;
  piece.told.last_s = t_s;
  piece.recent.push_back(place);
  while (piece.recent.size() > k_most_recent || t_s - piece.recent.front().t_s > k_recent_s)
    piece.recent.pop_front();
  if (piece.told.n > pieces_[largest_].told.n) largest_ = best;
  return best;
}

}  // namespace anchord
