#include "core/localize/live_flight.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>

#include "core/geo/tag_track.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/live_anchor.hpp"

namespace anchord {
namespace {

/// No model is believed beyond the noise of the radio itself: 2 cm at best.
constexpr double k_least_sigma_m = 0.02;

}  // namespace

struct LiveFlight::State {
  Mission mission;
  LiveOptions options;
  std::optional<UtcTime> epoch;
  std::optional<EnuFrame> frame;
  std::deque<TrackPose> track;  ///< ascending; only as long as ranges may still ask for it
  struct Waiting {
    Range range;
    std::optional<RangeModel> model;
    std::string told;  ///< why it counts as refused for now; empty while nobody was told
  };
  std::multimap<std::int64_t, Waiting> waiting;  ///< by time: ranges the track does not cover yet
  std::int64_t newest_range_ns{0}, told_until_ns{std::numeric_limits<std::int64_t>::min()};
  std::map<NetworkId, LiveAnchor> anchors;
  std::map<NetworkId, LiveAnchor> uncorrected;  ///< those with corrected ranges, as they were without
  std::vector<RangeResult> results;
  std::set<NetworkId> changed;
  bool held{false};
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

  /// Where the first tag is; nothing where it hangs off the track point and the attitude is not known.
  std::optional<Eigen::Vector3d> tag_at(const TrackPose& at) const {
    const Eigen::Vector3d arm =
        mission.tags.empty() ? Eigen::Vector3d::Zero() : mission.tags.front().lever_arm_body_m;
    if (!at.attitude && arm.norm() > 1e-9) return std::nullopt;
    return interpolate(at, at, at.t_s, arm).position_m;
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
    if (results.size() >= std::min<std::size_t>(options.max_waiting, 5000))
      results.erase(results.begin(), results.begin() + static_cast<std::ptrdiff_t>(results.size() / 2));
    results.push_back(std::move(result));
  }

  enum class Fate : std::uint8_t { decided, waits, outside, gap };

  /// Joins one range to the track as it is now; what is not decided may be, once more fixes have come.
  Fate decide(const Waiting& entry) {
    const Range& range = entry.range;
    const double t_s = seconds(range.time) + options.lag_s;
    if (track.empty()) return Fate::waits;
    if (t_s < track.front().t_s) return Fate::outside;
    const auto after = std::ranges::lower_bound(track, t_s, {}, &TrackPose::t_s);
    if (after == track.end()) return Fate::waits;
    const auto before = after == track.begin() ? after : std::prev(after);
    if (after->t_s - before->t_s > options.max_gap_s) return Fate::gap;
    if (before->fix < options.min_fix || after->fix < options.min_fix) {
      refuse(range, "fix_not_good_enough");
    } else if (const auto arm = lever_arm(range); !arm) {
      refuse(range, "unknown_tag");
    } else {
      use(entry, interpolate(*before, *after, t_s, *arm));
    }
    return Fate::decided;
  }

  void tell(Waiting& entry, const char* why) {
    if (!entry.told.empty()) return;
    entry.told = why;
    refuse(entry.range, why);
  }

  /// True when the range is done with; else it stays parked.
  bool settle(Waiting& entry) {
    if (!epoch) return false;
    const std::string told = entry.told;
    const Fate fate = decide(entry);
    if (fate == Fate::outside) tell(entry, "outside_track");
    if (fate == Fate::gap) tell(entry, "track_gap");
    if (fate == Fate::decided && !told.empty()) anchors.at(entry.range.anchor).forgive(told);
    return fate == Fate::decided;
  }

  /// The track changed between these instants: whatever waits there is looked at again.
  void settle_between(double from_s, double to_s) {
    const auto ns = [&](double t_s) { return epoch->ns + static_cast<std::int64_t>(t_s * 1e9); };
    auto it = waiting.lower_bound(ns(from_s - options.lag_s) - 1);
    const auto end = waiting.upper_bound(ns(to_s - options.lag_s) + 1);
    while (it != end) it = settle(it->second) ? waiting.erase(it) : std::next(it);
  }

  void settle_all() {
    for (auto it = waiting.begin(); it != waiting.end();)
      it = settle(it->second) ? waiting.erase(it) : std::next(it);
  }

  void park(Waiting entry) {
    const std::int64_t ns = entry.range.time.ns;
    const auto late_ns = static_cast<std::int64_t>(options.max_wait_s * 1e9);
    newest_range_ns = std::max(newest_range_ns, ns);
    if (ns < told_until_ns) tell(entry, "no_fix_in_time");
    waiting.emplace(ns, std::move(entry));
    // Time moves on with the ranges too: without fixes nobody is left to wonder.
    if (newest_range_ns - late_ns > told_until_ns) {
      auto it = waiting.lower_bound(told_until_ns);
      told_until_ns = newest_range_ns - late_ns;
      for (; it != waiting.end() && it->first < told_until_ns; ++it) tell(it->second, "no_fix_in_time");
    }
    while (waiting.size() > options.max_waiting) {
      tell(waiting.begin()->second, "waited_too_long");
      waiting.erase(waiting.begin());
    }
  }

  void use(const Waiting& entry, const TagPoint& point) {
    const Range& range = entry.range;
    const auto& model = entry.model;
    Observation row;
    row.tag_m = point.position_m;
    row.distance_m = range.distance_m;
    row.sigma_m = options.range_sigma_m;
    row.tag_covariance_m2 = point.covariance_m2;
    auto& anchor = anchors.try_emplace(range.anchor, range.anchor).first->second;
    if (model && model->bias_m) {
      // The same flight without the models, from its first corrected range on: what they change can be seen.
      auto& raw = uncorrected.try_emplace(range.anchor, anchor).first->second;
      raw.add(row, range.time, options, held);
      row.distance_m -= *model->bias_m;
      if (model->sigma_m) row.sigma_m = std::max(*model->sigma_m, k_least_sigma_m);
    } else if (const auto raw = uncorrected.find(range.anchor); raw != uncorrected.end()) {
      raw->second.add(row, range.time, options, held);
    }
    if (anchor.add(row, range.time, options, held)) changed.insert(range.anchor);
    RangeResult result;
    result.range = range;
    result.model = model;
    result.range.cir.reset();
    result.sigma_m = std::sqrt(row.sigma_m * row.sigma_m + point.covariance_m2.trace() / 3.0);
    result.tag_enu_m = point.position_m;
    result.corrected_m = row.distance_m - anchor.correction_m(row.distance_m, options);
    result.residual_m = anchor.residual_m(row, options);
    keep(std::move(result));
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
    LivePose live{fix.time, fix, pose.position_m, std::nullopt, s.tag_at(pose)};
    if (!s.track.empty() && pose.t_s - s.track.back().t_s < 2.0) {
      live.speed_mps = (pose.position_m - s.track.back().position_m).norm() / (pose.t_s - s.track.back().t_s);
    }
    s.pose = std::move(live);
  }
  const double t_s = pose.t_s;
  const auto at = s.track.insert(place, std::move(pose));
  const double from_s = at == s.track.begin() ? t_s : std::prev(at)->t_s;
  const double to_s = std::next(at) == s.track.end() ? t_s : std::next(at)->t_s;
  s.settle_between(from_s, to_s);
  if (s.track.size() > s.options.max_track) s.track.pop_front();
}

void LiveFlight::add(const Range& range, const std::optional<RangeModel>& model) {
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
  State::Waiting entry{range, model, {}};
  entry.range.cir.reset();
  if (!s.settle(entry)) s.park(std::move(entry));
}

void LiveFlight::tell(std::map<NetworkId, AnchorClues> clues) { state_->options.clues = std::move(clues); }

void LiveFlight::adopt(const FlightSolution& solution, UtcTime cut) {
  State& s = *state_;
  s.options.bias_m = solution.shared.bias_m.value;
  const double lag_before_s = std::exchange(s.options.lag_s, solution.shared.lag_s.value);
  for (const auto& anchor : solution.anchors) {
    const NetworkId id = anchor.estimate.anchor;
    auto& live = s.anchors.try_emplace(id, id).first->second;
    if (live.adopt(anchor, solution.shared, cut)) s.changed.insert(id);
  }
  // A smaller lag lets ranges that wait for the next fix stand before the last one, where no later fix looks.
  if (s.options.lag_s < lag_before_s) s.settle_all();
}

void LiveFlight::hold(bool held) {
  State& s = *state_;
  s.held = held;
  if (held) return;
  for (auto& [id, anchor] : s.anchors) {
    if (anchor.solve(s.options)) s.changed.insert(id);
  }
  for (auto& [id, anchor] : s.uncorrected) (void)anchor.solve(s.options);
}

void LiveFlight::finish() {
  for (auto& [ns, entry] : state_->waiting) state_->tell(entry, "outside_track");
  for (auto& [id, anchor] : state_->anchors) {
    if (anchor.solve(state_->options)) state_->changed.insert(id);
  }
  for (auto& [id, anchor] : state_->uncorrected) (void)anchor.solve(state_->options);
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

std::optional<double> LiveFlight::uncorrected_shift_m(NetworkId anchor) const {
  const auto raw = state_->uncorrected.find(anchor);
  if (raw == state_->uncorrected.end()) return std::nullopt;
  const auto with = state_->anchors.at(anchor).estimate(state_->frame),
             without = raw->second.estimate(state_->frame);
  if (!with.best || !without.best) return std::nullopt;
  return (with.best->position.m - without.best->position.m).norm();
}

std::optional<LivePose> LiveFlight::pose() const { return state_->pose; }

std::optional<Wgs84> LiveFlight::origin() const {
  if (!state_->frame) return std::nullopt;
  return state_->frame->origin();
}

}  // namespace anchord
