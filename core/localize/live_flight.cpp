#include "core/localize/live_flight.hpp"

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <map>
#include <set>
#include <utility>

#include "core/geo/tag_track.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/live_anchor.hpp"
#include "core/localize/live_track.hpp"
#include "core/localize/seen_exchanges.hpp"

namespace anchord {
namespace {

/// No model is believed beyond the noise of the radio itself: 2 cm at best.
constexpr double k_least_sigma_m = 0.02;
constexpr double k_same_origin_m = 1e-3;

}  // namespace

struct LiveFlight::State {
  Mission mission;
  LiveOptions options;
  LiveTrack track;
  struct Logged {
    Range range;
    std::optional<RangeModel> model;
  };
  std::vector<Logged> log;  ///< of good ranges, thinned: for when the track turns out to be another
  std::size_t log_stride{1}, log_skipped{0};
  bool replaying{false};
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
  SeenExchanges seen;  ///< against repeats

  State(Mission m, LiveOptions o)
      : mission(std::move(m)),
        options(std::move(o)),
        track(mission.frame, {options.min_fix, options.max_track, options.origin, options.track}),
        seen(4 * options.max_waiting) {}

  double seconds(UtcTime t) const { return seconds_between(*track.epoch(), t); }

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
    if (replaying) return;  // told already, for better or worse
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
    const auto& poses = track.poses();
    if (poses.empty()) return Fate::waits;
    if (t_s < poses.front().t_s) return Fate::outside;
    const auto after = std::ranges::lower_bound(poses, t_s, {}, &TrackPose::t_s);
    if (after == poses.end()) return Fate::waits;
    const auto before = after == poses.begin() ? after : std::prev(after);
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

  void set_priors(Waiting& entry, const char* why) {
    if (!entry.told.empty()) return;
    entry.told = why;
    refuse(entry.range, why);
  }

  /// True when the range is done with; else it stays parked.
  bool settle(Waiting& entry) {
    if (!track.epoch()) return false;
    const std::string told = entry.told;
    const Fate fate = decide(entry);
    if (fate == Fate::outside) set_priors(entry, "outside_track");
    if (fate == Fate::gap) set_priors(entry, "track_gap");
    if (fate == Fate::decided && !told.empty()) anchors.at(entry.range.anchor).forgive(told);
    return fate == Fate::decided;
  }

  /// The track changed between these instants: whatever waits there is looked at again.
  void settle_between(double from_s, double to_s) {
    const auto ns = [&](double t_s) { return track.epoch()->ns + static_cast<std::int64_t>(t_s * 1e9); };
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
    if (ns < told_until_ns) set_priors(entry, "no_fix_in_time");
    waiting.emplace(ns, std::move(entry));
    // Time moves on with the ranges too: without fixes nobody is left to wonder.
    if (newest_range_ns - late_ns > told_until_ns) {
      auto it = waiting.lower_bound(told_until_ns);
      told_until_ns = newest_range_ns - late_ns;
      for (; it != waiting.end() && it->first < told_until_ns; ++it) set_priors(it->second, "no_fix_in_time");
    }
    while (waiting.size() > options.max_waiting) {
      set_priors(waiting.begin()->second, "waited_too_long");
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

  void remember(const Range& range, const std::optional<RangeModel>& model) {
    if (log_skipped++ % log_stride != 0) return;
    log.push_back({range, model});
    log.back().range.cir.reset();
    if (log.size() < options.max_logged) return;
    std::size_t kept = 0;
    for (std::size_t i = 0; i < log.size(); i += 2) log[kept++] = std::move(log[i]);
    log.resize(kept);
    log_stride *= 2;
  }

  void solve_all() {
    for (auto& [id, anchor] : anchors) {
      if (anchor.solve(options)) changed.insert(id);
    }
    for (auto& [id, anchor] : uncorrected) (void)anchor.solve(options);
  }

  /// The track is another: what was joined to the old one is joined to this one, and every anchor begins
  /// anew.
  void rebuild() {
    const auto before = std::exchange(anchors, {});
    for (const auto& [id, anchor] : before) {
      auto& fresh = anchors.try_emplace(id, id).first->second;
      for (const auto& [why, n] : anchor.estimate({}).refused) {
        // Of the range itself, whatever the track; the others are asked again.
        if (why == "zero_range" || why == "out_of_bounds" || why == "duplicate" || why == "excluded")
          fresh.refuse(why, n);
      }
    }
    uncorrected.clear();
    waiting.clear();
    newest_range_ns = 0;
    told_until_ns = std::numeric_limits<std::int64_t>::min();
    const bool was_held = std::exchange(held, true);
    replaying = true;
    for (const Logged& one : log) {
      Waiting entry{one.range, one.model, {}};
      if (!settle(entry)) park(std::move(entry));
    }
    replaying = false;
    held = was_held;
    if (!held) solve_all();
    for (const auto& [id, anchor] : anchors) changed.insert(id);
  }

  void follow(const LiveTrack::Change& change) {
    if (change.rebuilt)
      rebuild();
    else if (change.added)
      settle_between(change.from_s, change.to_s);
  }
};

LiveFlight::LiveFlight(Mission mission, LiveOptions options)
    : state_(std::make_unique<State>(std::move(mission), std::move(options))) {}
LiveFlight::~LiveFlight() = default;
LiveFlight::LiveFlight(LiveFlight&&) noexcept = default;
LiveFlight& LiveFlight::operator=(LiveFlight&&) noexcept = default;

void LiveFlight::add(const Fix& fix) { state_->follow(state_->track.add(fix)); }

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
  if (!s.seen.insert(range)) {
    s.refuse(range, "duplicate");
    return;
  }
  s.remember(range, model);
  State::Waiting entry{range, model, {}};
  entry.range.cir.reset();
  if (!s.settle(entry)) s.park(std::move(entry));
}

void LiveFlight::leave_out(const Range& range) { state_->refuse(range, "excluded"); }

void LiveFlight::set_priors(std::map<NetworkId, AnchorPriors> priors) {
  state_->options.priors = std::move(priors);
}

void LiveFlight::adopt(const FlightSolution& solution, UtcTime cut) {
  State& s = *state_;
  // Solved before the origin was another: its numbers are of another frame.
  if (solution.origin && s.track.frame() &&
      s.track.frame()->enu_from_wgs84(*solution.origin).m.norm() > k_same_origin_m)
    return;
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
  s.follow(s.track.settle());
  s.solve_all();
}

void LiveFlight::finish() {
  state_->follow(state_->track.settle());
  for (auto& [ns, entry] : state_->waiting) state_->set_priors(entry, "outside_track");
  state_->solve_all();
}

std::vector<RangeResult> LiveFlight::take_ranges() { return std::exchange(state_->results, {}); }

std::vector<Estimate> LiveFlight::take_estimates() {
  std::vector<Estimate> changed;
  for (const NetworkId id : std::exchange(state_->changed, {})) {
    changed.push_back(state_->anchors.at(id).estimate(state_->track.frame()));
  }
  return changed;
}

std::vector<Estimate> LiveFlight::estimates() const {
  std::vector<Estimate> all;
  for (const auto& [id, anchor] : state_->anchors) all.push_back(anchor.estimate(state_->track.frame()));
  return all;
}

std::optional<LiveFlight::ModelShift> LiveFlight::model_shift(NetworkId anchor) const {
  const auto raw = state_->uncorrected.find(anchor);
  if (raw == state_->uncorrected.end()) return std::nullopt;
  const auto with = state_->anchors.at(anchor).estimate(state_->track.frame()),
             without = raw->second.estimate(state_->track.frame());
  if (!with.best || !without.best) return std::nullopt;
  ModelShift out{std::numeric_limits<double>::infinity(), std::hypot(without.h95_m, without.v95_m)};
  for (const auto* here : {&with.best, &with.mirror})
    for (const auto* there : {&without.best, &without.mirror})
      if (*here && *there) out.m = std::min(out.m, ((*here)->position.m - (*there)->position.m).norm());
  return out;
}

std::optional<Wgs84> LiveFlight::origin() const {
  if (!state_->track.frame()) return std::nullopt;
  return state_->track.frame()->origin();
}

std::map<std::string, std::size_t> LiveFlight::fixes_refused() const { return state_->track.refused(); }

}  // namespace anchord
