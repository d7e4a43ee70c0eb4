#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace anchord {

struct TrackPose;

/// How far a straight line between two epochs misses the way that was flown, measured on the track itself:
/// its own epochs are left out one, two, four, ... at a time and asked for again. Between and beyond the
/// spans measured by the power law of the nearest two (2: constant acceleration).
class InterpolationError {
 public:
  /// poses  ascending in time, of the quality that will be used; fewer than k_least triples of any span:
  ///        constant acceleration of 1 m/s^2 per axis, as aircraft fly round buildings
  explicit InterpolationError(std::span<const TrackPose> poses);

  /// One sigma per axis, `share` (0..1) of the way through an interval; 0 at its ends.
  double sigma_m(double interval_s, double share) const;

  static constexpr std::size_t k_least = 10;

 private:
  struct Span {
    double interval_s{}, midway_m{};
  };
  std::vector<Span> spans_;  ///< ascending; at least one
};

}  // namespace anchord
