#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/time.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/interpolation_error.hpp"
#include "core/types/fix.hpp"

namespace anchord {

/// One epoch of the track in the frame of the answer.
struct TrackPose {
  double t_s{};  ///< since the epoch of the track
  Eigen::Vector3d position_m{0, 0, 0};
  std::optional<Eigen::Quaterniond> attitude{};  ///< frame <- body
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
  FixClass fix{FixClass::none};
};

/// Why the track says nothing about an instant.
enum class TrackRefusal : std::uint8_t { none, outside, gap, fix_class };
/// The words under which refused ranges are counted.
inline constexpr auto k_track_refusal_words =
    enum_table<TrackRefusal>({{"none", TrackRefusal::none},
                              {"outside_track", TrackRefusal::outside},
                              {"track_gap", TrackRefusal::gap},
                              {"fix_not_good_enough", TrackRefusal::fix_class}});
constexpr std::string_view to_string(TrackRefusal why) { return k_track_refusal_words.word(why); }

/// A tag antenna at one instant.
struct TagPoint {
  TrackRefusal refused{TrackRefusal::none};
  Eigen::Vector3d position_m{0, 0, 0};  ///< of the antenna
  Eigen::Vector3d velocity_mps{0, 0, 0};
  Eigen::Vector3d body_up{0, 0, 1};       ///< unit vector, for the vertical antenna offset
  Eigen::Vector3d body_forward{0, 0, 0};  ///< unit vector; zero where attitude is unknown
  Eigen::Vector3d body_left{0, 0, 0};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
};

struct TrackOptions {
  FixClass min_fix{FixClass::rtk_fixed};
  /// Longest interval between neighbours to place a range in; absent: any whose interpolation error stays
  /// below 0.5 m.
  std::optional<double> max_gap_s{};
};

/// The two epochs about an instant.
struct TrackInterval {
  TrackRefusal refused{TrackRefusal::none};
  const TrackPose *before{}, *later{};  ///< of the track; one and the same at its last epoch; none: refused
  double missed_m{};                    ///< by the straight line between them, one sigma
};

/// Where a tag antenna was at any instant between two epochs of the track.
///
/// Position linear between the neighbours, attitude by slerp, lever arm added (body: forward, left, up).
/// Never extrapolates, and both neighbours must be of the asked class. Covariance is the mean of the
/// neighbours' weighted by nearness (their errors are nearly the same error, so interpolation does not
/// average it), plus what the straight line between them misses: the longer the gap, the less a range in it
/// counts. Without attitude the body is taken as level, and only the upward part of the lever arm is applied.
/// Const calls from any thread.
class TagTrack {
 public:
  /// fixes  any order; all of one TrackFrame; `frame` is needed for wgs84 and ignored for local
  /// epoch  the instant of t_s = 0
  TagTrack(std::span<const Fix> fixes, const std::optional<EnuFrame>& frame, UtcTime epoch,
           const TrackOptions& options = {});

  TagPoint at(double t_s, const Eigen::Vector3d& lever_arm_body_m = Eigen::Vector3d::Zero()) const;
  /// What `at` interpolates in.
  TrackInterval interval_at(double t_s) const;
  std::span<const TrackPose> poses() const { return poses_; }
  bool has_attitude() const { return has_attitude_; }
  const InterpolationError& interpolation_error() const { return missed_; }

 private:
  void index();
  std::size_t span_of(double t_s) const;  ///< t_s no earlier than the first pose
  /// First pose later than t_s.
  std::size_t after(double t_s) const;

  std::vector<TrackPose> poses_;  ///< ascending in time, no two at one instant
  std::vector<double> times_s_;   ///< of the poses, side by side to be searched
  /// As many spans of equal length as poses: first pose later than the begin of each, so that a search looks
  /// at one or two, as a rule, whatever the length of the flight.
  std::vector<std::uint32_t> spans_;
  double spans_per_s_{0};
  std::vector<double> missed_midway_m_;  ///< between the pose before and this
  FixClass min_fix_;
  std::optional<double> max_gap_s_;
  InterpolationError missed_{std::span<const TrackPose>{}};
  bool has_attitude_{false};
};

/// Usual size of the error of one axis, by class.
double default_sigma_m(FixClass fix);
/// Pose of one fix; covariance by fix class where the source gave none (fixed: 400 mm^2 per axis, mission row
/// 2).
TrackPose pose_of(const Fix& fix, const std::optional<EnuFrame>& frame, UtcTime epoch);
/// Between two poses, no questions asked; t_s within them.
TagPoint interpolate(const TrackPose& before, const TrackPose& after, double t_s,
                     const Eigen::Vector3d& lever_arm_body_m);

}  // namespace anchord
