#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <variant>
#include <vector>

#include "core/geo/enu.hpp"
#include "core/localize/live_track.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"

namespace anchord::flight {

/// A position where the aircraft can have been: whoever flies may steer by it.
struct FixBelieved {
  Fix fix;
};
/// Five of these a second of measured time: how the rover's solution stands.
struct FixShown {
  Fix fix;
};
/// Where the aircraft is; ten of these a second of measured time.
struct PoseMoved {
  UtcTime time{};
  Fix fix;
  Eigen::Vector3d enu_m{0, 0, 0};  ///< of the track point; local x, y, z in a local frame
  std::optional<double> speed_mps{};
  /// Of the mission's first tag; absent where nothing says how it hangs.
  std::optional<Eigen::Vector3d> tag_enu_m{};
};
using PositionEvent = std::variant<FixBelieved, FixShown, PoseMoved>;

/// Where the aircraft of a mission is, the moment a fix arrives: apart from LiveMission, whose strand
/// may be solving, or reading what was stored, for seconds. Two seconds without a position are a hold.
///
/// Judges by the rule of the estimates (LiveTrack), driven by measured times alone. Not thread-safe.
class PositionWatch {
 public:
  /// origin  of the site, where it has one
  PositionWatch(Mission mission, const TrackLimits& limits, const std::optional<Wgs84>& origin,
                std::vector<Exclusion> exclusions);

  /// What a fix means now. Empty for one that was reported already.
  std::vector<PositionEvent> add(const Fix& fix);
  /// Other rows are excluded from here on: fixes are held against the last one believed, if it still is.
  void begin_anew(std::vector<Exclusion> exclusions);
  /// Poses are shown in the frame of the estimates.
  void share_origin(const std::optional<Wgs84>& origin);
  /// The newest one, and none before the first believed fix.
  const std::optional<PoseMoved>& pose() const { return pose_; }

 private:
  void move_to(const LiveTrack::Change& change, const Fix& fix);
  Eigen::Vector3d shown_m(const Eigen::Vector3d& track_m) const;

  Mission mission_;
  LiveTrack::Options options_;
  std::vector<Exclusion> exclusions_;
  LiveTrack track_;
  std::optional<EnuFrame> shown_in_;
  std::optional<Fix> believed_;
  std::optional<PoseMoved> pose_;
  std::optional<UtcTime> newest_;
  std::int64_t last_pose_us_{0}, last_fix_us_{0};
};

}  // namespace anchord::flight
