#include "core/localize/live_flight.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>
#include <tuple>
#include <utility>

#include "core/geo/tag_track.hpp"
#include "core/localize/live_anchor.hpp"

namespace anchord {

struct LiveFlight::State {
  Mission mission;
  LiveOptions options;
  std::optional<UtcTime> epoch;
  std::optional<EnuFrame> frame;
  std::deque<TrackPose> track;  ///< ascending; only as long as ranges may still ask for it
  std::deque<Range> waiting;    ///< ranges the track has not passed yet
  std::map<NetworkId, LiveAnchor> anchors;
  std::vector<RangeResult> results;
  std::set<NetworkId> changed;
  std::optional<LivePose> pose;
  using Identity = std::tuple<std::int64_t, NetworkId, std::uint8_t, NetworkId>;
  std::set<Identity> seen;  ///< of the last seconds, against repeats

  State(Mission m, LiveOptions o) : mission(std::move(m)), options(std::move(o)) {
    if (mission.frame == TrackFrame::wgs84 && options.origin) frame.emplace(*options.origin);
  }

  double seconds(UtcTime t) const { return seconds_between(*epoch, t); }

  std::optional<Eigen::Vector3d> lever_arm(const Range& range) const {
    for (const auto& antenna : mission.tags) {
      if (antenna.tag == range.tag && antenna.antenna == range.antenna) return antenna.lever_arm_body_m;
    }
    // A mission that declares no tags takes any as standing at the track point; one that does knows its own.
    if (mission.tags.empty()) return Eigen::Vector3d::Zero();
    return std::nullopt;
  }

  void refuse(const Range& range, std::string why) {
    RangeResult result;
    result.range = range;
    result.range.cir.reset();
    result.refused = std::move(why);
    if (range.kind == RangeKind::tag_anchor)
      anchors.try_emplace(range.anchor, range.anchor).first->second.refuse(result.refused);
    keep(std::move(result));
  }

  void keep(RangeResult result) {
    // Whoever does not collect loses the oldest, not the memory.
    if (results.size() >= options.max_waiting)
      results.erase(results.begin(), results.begin() + static_cast<std::ptrdiff_t>(results.size() / 2));
    results.push_back(std::move(result));
  }

  /// Joins one range to the track; false while the fix after it has not come.
  bool decide(const Range& range) {
    const double t_s = seconds(range.time) + options.lag_s;
    if (track.empty() || t_s < track.front().t_s) {
      refuse(range, "outside_track");
      return true;
    }
    const auto after = std::ranges::lower_bound(track, t_s, {}, &TrackPose::t_s);
    if (after == track.end()) return false;
    const auto before = after == track.begin() ? after : std::prev(after);
    if (after->t_s - before->t_s > options.max_gap_s) {
      refuse(range, "track_gap");
    } else if (before->fix < options.min_fix || after->fix < options.min_fix) {
      refuse(range, "fix_not_good_enough");
    } else if (const auto arm = lever_arm(range); !arm) {
      refuse(range, "unknown_tag");
    } else {
      use(range, interpolate(*before, *after, t_s, *arm));
    }
    return true;
  }

  void use(const Range& range, const TagPoint& point) {
    Observation row;
    row.tag_m = point.position_m;
    row.distance_m = range.distance_m - options.bias_m;
    row.sigma_m = options.range_sigma_m;
    row.tag_covariance_m2 = point.covariance_m2;
    auto& anchor = anchors.try_emplace(range.anchor, range.anchor).first->second;
    if (anchor.add(row, range.time, options)) changed.insert(range.anchor);
    RangeResult result;
    result.range = range;
    result.range.cir.reset();
    result.sigma_m = std::sqrt(row.sigma_m * row.sigma_m + point.covariance_m2.trace() / 3.0);
    result.tag_enu_m = point.position_m;
    result.residual_m = anchor.residual_m(row);
    keep(std::move(result));
  }

  void decide_waiting(bool last_call) {
    const double newest_s = track.empty() ? 0.0 : track.back().t_s;
    std::deque<Range> still;
    for (auto& range : waiting) {
      if (epoch && decide(range)) continue;
      if (last_call) {
        refuse(range, "outside_track");
      } else {
        still.push_back(std::move(range));
      }
    }
    waiting = std::move(still);
    while (waiting.size() > options.max_waiting) {
      refuse(waiting.front(), "waited_too_long");
      waiting.pop_front();
    }
    // Late rows may still come for a while; older track than that is of no use.
    while (track.size() > 2 && track[1].t_s < newest_s - 10.0) track.pop_front();
  }
};

LiveFlight::LiveFlight(Mission mission, LiveOptions options)
    : state_(std::make_unique<State>(std::move(mission), std::move(options))) {}
LiveFlight::~LiveFlight() = default;
LiveFlight::LiveFlight(LiveFlight&&) noexcept = default;
LiveFlight& LiveFlight::operator=(LiveFlight&&) noexcept = default;

void LiveFlight::add(const Fix& fix) {
  State& s = *state_;
  if (fix.fix == FixClass::none) return;
  const bool globe = s.mission.frame == TrackFrame::wgs84;
  if ((fix.frame == TrackFrame::wgs84) != globe) return;
  if (globe && !s.frame) {
    if (fix.fix < s.options.min_fix) return;  // a bad origin would shift every later number by metres
    s.frame.emplace(fix.position);
  }
  if (!s.epoch) s.epoch = fix.time;
  TrackPose pose = pose_of(fix, s.frame, *s.epoch);
  if (!pose.position_m.allFinite() || !pose.covariance_m2.allFinite()) return;
  const auto place = std::ranges::lower_bound(s.track, pose.t_s, {}, &TrackPose::t_s);
  if (place != s.track.end() && place->t_s == pose.t_s) return;
  if (place == s.track.end()) {
    LivePose live{fix.time, fix, pose.position_m, std::nullopt};
    if (!s.track.empty() && pose.t_s - s.track.back().t_s < 2.0) {
      live.speed_mps = (pose.position_m - s.track.back().position_m).norm() / (pose.t_s - s.track.back().t_s);
    }
    s.pose = std::move(live);
  }
  s.track.insert(place, std::move(pose));
  s.decide_waiting(false);
}

void LiveFlight::add(const Range& range) {
  State& s = *state_;
  if (range.kind != RangeKind::tag_anchor) return;
  if (!std::isfinite(range.distance_m) || range.distance_m < 0.05) {
    s.refuse(range, range.distance_m == 0.0 ? "zero_range" : "out_of_bounds");
    return;
  }
  if (range.distance_m > 150.0) {
    s.refuse(range, "out_of_bounds");
    return;
  }
  const State::Identity identity{range.time.ns, range.tag, range.antenna, range.anchor};
  if (!s.seen.insert(identity).second) {
    s.refuse(range, "duplicate");
    return;
  }
  while (s.seen.size() > 4 * s.options.max_waiting) s.seen.erase(s.seen.begin());
  if (s.epoch && s.decide(range)) return;
  s.waiting.push_back(range);
  if (s.waiting.size() > s.options.max_waiting) {
    s.refuse(s.waiting.front(), "waited_too_long");
    s.waiting.pop_front();
  }
  // Time moves on with the ranges too: without fixes a range does not wait for ever.
  while (!s.waiting.empty() && seconds_between(s.waiting.front().time, range.time) > s.options.max_wait_s) {
    s.refuse(s.waiting.front(), "no_fix_in_time");
    s.waiting.pop_front();
  }
}

void LiveFlight::finish() {
  state_->decide_waiting(true);
  for (auto& [id, anchor] : state_->anchors) {
    if (anchor.solve(state_->options)) state_->changed.insert(id);
  }
}

std::vector<RangeResult> LiveFlight::take_ranges() { return std::exchange(state_->results, {}); }

std::vector<Estimate> LiveFlight::take_estimates() {
  std::vector<Estimate> changed;
  for (const NetworkId id : std::exchange(state_->changed, {})) {
    changed.push_back(state_->anchors.at(id).estimate(state_->frame));
  }
  return changed;
}

std::vector<Estimate> LiveFlight::estimates() const {
  std::vector<Estimate> all;
  for (const auto& [id, anchor] : state_->anchors) all.push_back(anchor.estimate(state_->frame));
  return all;
}

std::optional<LivePose> LiveFlight::pose() const { return state_->pose; }

std::optional<Wgs84> LiveFlight::origin() const {
  if (!state_->frame) return std::nullopt;
  return state_->frame->origin();
}

}  // namespace anchord
