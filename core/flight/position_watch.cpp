#include "core/flight/position_watch.hpp"

#include <cmath>
#include <utility>

namespace anchord::flight {
namespace {

constexpr std::int64_t k_pose_interval_us = 100'000;  // 10 Hz of measured time
constexpr std::int64_t k_fix_interval_us = 200'000;
constexpr double k_speed_s = 2.0;  // between the two poses of a speed, at most

/// Once in each interval of measured time, also where the time went back.
bool due(std::int64_t now_us, std::int64_t& last_us, std::int64_t interval_us) {
  if (now_us - last_us < interval_us && now_us >= last_us) return false;
  last_us = now_us;
  return true;
}

bool same(const Wgs84& a, const Wgs84& b) {
  return a.lat_deg == b.lat_deg && a.lon_deg == b.lon_deg && a.height_m == b.height_m;
}

/// Where the first tag is, in the frame of the pose; nothing where it hangs off the track point and the
/// attitude is not known.
std::optional<Eigen::Vector3d> tag_at(const Mission& mission, const TrackPose& at) {
  const Eigen::Vector3d arm =
      mission.tags.empty() ? Eigen::Vector3d::Zero() : mission.tags.front().lever_arm_body_m;
  if (!at.attitude && arm.norm() > 1e-9) return std::nullopt;
  return interpolate(at, at, at.t_s, arm).position_m;
}

}  // namespace

PositionWatch::PositionWatch(Mission mission, const TrackLimits& limits, const std::optional<Wgs84>& origin,
                             std::vector<Exclusion> exclusions)
    : mission_(std::move(mission)),
      options_{.origin = origin, .limits = limits},
      exclusions_(std::move(exclusions)),
      track_(mission_.frame, options_) {}

std::vector<PositionEvent> PositionWatch::add(const Fix& fix) {
  if (newest_ && fix.time == *newest_) return {};
  newest_ = fix.time;
  std::vector<PositionEvent> events;
  if (!excluded(exclusions_, fix)) {
    const auto change = track_.add(fix);
    move_to(change, fix);
    if (change.believed) {
      believed_ = fix;
      events.emplace_back(FixBelieved{fix});
    }
  }
  const std::int64_t now_us = fix.time.us();
  if (pose_ && due(now_us, last_pose_us_, k_pose_interval_us)) events.emplace_back(*pose_);
  if (due(now_us, last_fix_us_, k_fix_interval_us)) events.emplace_back(FixShown{fix});
  return events;
}

void PositionWatch::begin_anew(std::vector<Exclusion> exclusions) {
  exclusions_ = std::move(exclusions);
  track_ = LiveTrack(mission_.frame, options_);
  if (believed_ && excluded(exclusions_, *believed_)) believed_.reset();
  if (believed_) track_.add(*believed_);
}

void PositionWatch::share_origin(const std::optional<Wgs84>& origin) {
  if (!origin || mission_.frame != TrackFrame::wgs84) return;
  if (!shown_in_ || !same(shown_in_->origin(), *origin)) shown_in_.emplace(*origin);
}

Eigen::Vector3d PositionWatch::shown_m(const Eigen::Vector3d& track_m) const {
  if (!shown_in_ || !track_.frame()) return track_m;
  return shown_in_->enu_from_wgs84(track_.frame()->wgs84_from_enu(Enu{track_m})).m;
}

void PositionWatch::move_to(const LiveTrack::Change& change, const Fix& fix) {
  if (!change.newest) return;
  const TrackPose& now = *change.newest;
  PoseMoved moved;
  moved.time = {track_.epoch()->ns + std::llround(now.t_s * 1e9)};
  moved.fix = fix;
  moved.enu_m = shown_m(now.position_m);
  if (const auto tag = tag_at(mission_, now)) moved.tag_enu_m = shown_m(*tag);
  const double since_s = pose_ ? seconds_between(pose_->time, moved.time) : 0;
  if (since_s > 0 && since_s < k_speed_s && !change.rebuilt)
    moved.speed_mps = (moved.enu_m - pose_->enu_m).norm() / since_s;
  pose_ = std::move(moved);
}

}  // namespace anchord::flight
