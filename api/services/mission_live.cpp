#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "api/services/mission_observer.hpp"
#include "api/services/mission_service_state.hpp"
#include "core/base/guard.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {

namespace {

constexpr std::int64_t k_pose_interval_us = 100'000;  // 10 Hz of measurement time
constexpr std::int64_t k_rtk_interval_us = 200'000;

}  // namespace

LiveRow MissionService::State::row_of(Range range) const {
  JudgedRange row{std::move(range), {}, {}};
  row.time = row.range.time;
  if (deps.judge) row.model = deps.judge(row.range);
  row.range.cir.reset();  // a queued row needs none, and it is 4 kB
  return row;
}

template <class R>
void MissionService::State::enqueue(Flight& flight, const R& row, SteadyTime now) {
  LiveRow judged = row_of(row);
  const std::scoped_lock lock(flight.queue_mutex);
  if (flight.gone) return;
  flight.last_arrival = flight.used = now;
  (std::is_same_v<R, Fix> ? flight.fix_arrival : flight.range_arrival) = now;
  if (flight.queue.size() >= k_max_queued_rows) {
    flight.queue.pop_front();
    ++flight.dropped;
    --queued;
  }
  flight.queue.push_back(std::move(judged));
  flight.closing = flight.mission.state == MissionState::finished;
  ++queued;
}

template <class R>
void MissionService::State::take_newest(std::span<const R> rows) {
  const SteadyTime now = steady_now();
  std::shared_ptr<Flight> flight;
  for (const auto& row : rows) {
    if (!flight || flight->id != row.mission) flight = find(row.mission);
    if (!flight) continue;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      // While it is read back from the store its newest row is not known.
      if (flight->rebuilding || !flight->ahead.take(row)) continue;
    }
    enqueue(*flight, row, now);
  }
  for (const auto& f : all()) schedule(f);
}

template <class R>
void MissionService::State::accept(std::span<const R> rows, std::span<const RowOutcome> outcomes) {
  const SteadyTime now = steady_now();
  std::shared_ptr<Flight> flight;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    if (!flight || flight->id != rows[i].mission) flight = find(rows[i].mission);
    if (!flight) continue;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      // Of several senders of one row the store accepts one: whoever was live with it, it has been had.
      if (outcomes[i] != RowOutcome::accepted || flight->ahead.settle(rows[i])) continue;
    }
    enqueue(*flight, rows[i], now);
  }
  for (const auto& f : all()) schedule(f);
}

template void MissionService::State::take_newest(std::span<const Range>);
template void MissionService::State::take_newest(std::span<const Fix>);
template void MissionService::State::accept(std::span<const Range>, std::span<const RowOutcome>);
template void MissionService::State::accept(std::span<const Fix>, std::span<const RowOutcome>);

void MissionService::State::schedule(const std::shared_ptr<Flight>& flight) {
  {
    const std::scoped_lock lock(flight->queue_mutex);
    if (flight->scheduled || stopped || flight->rebuilding) return;
    if (flight->queue.empty() && !flight->closing && !flight->new_clues) return;
    flight->scheduled = true;
  }
  post([self = shared_from_this(), flight] {
    const auto ran = guarded("live path", [&] {
      if (!self->stopped) self->work(*flight);
    });
    bool again = false;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      flight->scheduled = false;
      // Its rows are stored; a close that throws would be tried for ever.
      if (!ran) flight->closing = false;
      again = !flight->queue.empty() || flight->closing || flight->new_clues;
    }
    if (again) self->schedule(flight);
  });
}

/// On the pool, counted, so that stop() can wait for it.
void MissionService::State::post(std::function<void()> task) {
  {
    const std::scoped_lock lock(running_mutex);
    ++running;
  }
  auto counted = [self = shared_from_this(), task = std::move(task)] {
    (void)guarded("live path", task);
    {
      const std::scoped_lock lock(self->running_mutex);
      --self->running;
    }
    self->idle.notify_all();
  };
  if (deps.post)
    deps.post(std::move(counted));
  else
    counted();
}

void MissionService::State::work(Flight& flight) {
  // One slice: other missions and requests share the pool.
  std::deque<LiveRow> rows;
  std::uint64_t dropped = 0;
  {
    const std::scoped_lock lock(flight.queue_mutex);
    const std::size_t n = std::min<std::size_t>(flight.queue.size(), 500);
    for (std::size_t i = 0; i < n; ++i) {
      rows.push_back(std::move(flight.queue.front()));
      flight.queue.pop_front();
    }
    dropped = std::exchange(flight.dropped, 0);
  }
  queued -= rows.size();
  if (dropped > 0) {
    deps.events.add("warning", "live.behind",
                    std::to_string(dropped) + " measurements left the live path; they are stored", flight.id);
  }
  const std::scoped_lock lock(flight.work_mutex);
  if (flight.rebuilding) {
    // It begins anew: what was taken goes back to the head of the queue, and is worked off after what is
    // stored.
    const std::scoped_lock queue(flight.queue_mutex);
    queued += rows.size();
    for (auto it = rows.rbegin(); it != rows.rend(); ++it) flight.queue.push_front(std::move(*it));
    return;
  }
  take_clues(flight);
  tell_live(flight);
  std::size_t since_announced = 0;
  for (const auto& row : rows) {
    if (!flight.rebuilt.empty() && std::ranges::binary_search(flight.rebuilt, identity(row))) continue;
    step(flight, row, false);
    if (++since_announced == 100) {
      announce(flight, false);
      since_announced = 0;
    }
  }
  bool closing = false;
  {
    const std::scoped_lock queue(flight.queue_mutex);
    if (flight.queue.empty()) {
      flight.rebuilt = {};
      closing = std::exchange(flight.closing, false);
    }
  }
  if (closing) flight.live.finish();
  announce(flight, false);
  publish_pose(flight);
  flight.dirty = true;
  bool view_wanted = false;
  {
    const std::scoped_lock queue(flight.queue_mutex);
    view_wanted = std::exchange(flight.view_wanted, false);
  }
  if (!view_wanted) return;
  auto made = view(flight);
  const std::scoped_lock queue(flight.queue_mutex);
  flight.view = std::move(made);
  flight.view_made = steady_now();
}

void MissionService::State::step(Flight& flight, const LiveRow& row, bool quiet) {
  auto& state = flight.state;
  const UtcTime time = time_of(row);
  if (!state.started || time < *state.started) state.started = time;
  if (!(time < state.time) || state.n_ranges + state.n_fixes == 0) state.time = time;
  if (const auto* judged = std::get_if<JudgedRange>(&row)) {
    const Range* range = &judged->range;
    ++state.n_ranges;
    if (!quiet) {
      const SteadyTime now = steady_now();
      radios.heard(range->tag, range->kind == RangeKind::tag_anchor, time, now);
      radios.heard(range->anchor, false, time, now);
    }
    flight.range_times_us.push_back(time.us());
    if (flight.range_times_us.size() > 100) flight.range_times_us.pop_front();
    const double span_s =
        static_cast<double>(flight.range_times_us.back() - flight.range_times_us.front()) * 1e-6;
    state.range_rate_hz = span_s > 0 ? static_cast<double>(flight.range_times_us.size() - 1) / span_s : 0;
    flight.watch.note_range(time);
    if (excluded(flight.exclusions, *range)) return flight.live.leave_out(*range);
    flight.history.add(corrected(*judged), belief_of(*judged));
    ++flight.ranges_since_joint;
    flight.live.add(*range, judged->model);
    return;
  }
  const auto& fix = std::get<Fix>(row);
  ++state.n_fixes;
  flight.watch.note(fix);
  bool believed = false;
  if (excluded(flight.exclusions, fix)) {
    ++state.n_fixes_excluded;
  } else {
    flight.history.add(fix);
    believed = flight.live.add(fix);
  }
  if (quiet) return;
  // Whoever flies by it hears of no place where the aircraft cannot be.
  if (auto* told = observer.load(); told != nullptr && believed) told->on_fix(fix);
  const std::int64_t now_us = fix.time.us();
  if (now_us - flight.last_pose_us >= k_pose_interval_us || now_us < flight.last_pose_us) {
    flight.last_pose_us = now_us;
    publish_pose(flight);
  }
  if (now_us - flight.last_rtk_us >= k_rtk_interval_us || now_us < flight.last_rtk_us) {
    flight.last_rtk_us = now_us;
    deps.hub.publish(Topic::rtk_status, live_rtk_json(flight.id, fix), now_us, to_string(flight.id));
    deps.hub.collect(Topic::fixes, live_fix_json(flight.id, fix), now_us);
  }
}

void MissionService::State::publish_pose(Flight& flight) {
  const auto pose = flight.live.pose();
  if (!pose) return;
  deps.hub.publish(Topic::drone_pose, live_pose_json(flight.id, flight.frame, *pose), pose->time.us(),
                   to_string(flight.id));
}

void MissionService::State::announce(Flight& flight, bool quiet) {
  const MissionId id = flight.id;
  for (const auto& result : flight.live.take_ranges()) {
    if (quiet) continue;
    if (auto* told = observer.load()) told->on_range(id, result);
    deps.hub.collect(Topic::ranges, live_range_json(id, result), result.range.time.us(), result.range.anchor);
  }
  for (auto& estimate : flight.live.take_estimates()) {
    judge_goal(estimate, deps.goal);
    const std::string status(live_status(estimate));
    auto& known = flight.statuses[estimate.anchor];
    if (known.empty()) {
      // From its first range on an anchor has an identity that facility data can hang on.
      later([&anchors = deps.anchors, who = estimate.anchor, now = deps.clock.now()]() -> Result<void> {
        BOOST_OUTCOME_TRYV(anchors.find_or_create(who, now));
        return boost::outcome_v2::success();
      });
      if (!quiet)
        deps.events.add("info", "anchor.found", "anchor " + to_string(estimate.anchor) + " found", id);
    }
    if (status != known && !quiet && (status == "converged" || status == "ambiguous")) {
      deps.events.add(status == "converged" ? "info" : "warning", "anchor." + status,
                      "anchor " + to_string(estimate.anchor) +
                          (status == "converged" ? " converged" : " is ambiguous: " + estimate.reason),
                      id);
    }
    known = status;
    deps.hub.publish(Topic::anchors_estimates,
                     live_estimate_json(id, estimate, flight.live.uncorrected_shift_m(estimate.anchor)),
                     estimate.time.us(), to_string(id) + to_string(estimate.anchor), estimate.anchor);
  }
  tell_fixes(flight, quiet);
  flight.state.anchors_found = flight.statuses.size();
  flight.state.anchors_converged =
      static_cast<std::size_t>(std::count_if(flight.statuses.begin(), flight.statuses.end(),
                                             [](const auto& entry) { return entry.second == "converged"; }));
}

/// Positions that are no part of the track, by reason; the first of each reason is an event, and so is an
/// origin that turned out to be none.
void MissionService::State::tell_fixes(Flight& flight, bool quiet) {
  flight.state.fixes_refused = flight.live.fixes_refused();
  if (flight.state.n_fixes_excluded > 0)
    flight.state.fixes_refused["excluded"] = flight.state.n_fixes_excluded;
  for (const auto& [reason, n] : flight.state.fixes_refused) {
    if (reason == "not_usable" || !flight.fixes_told.try_emplace(reason, n).second || quiet) continue;
    deps.events.add("warning", "track." + reason,
                    reason == "excluded" ? "positions were excluded by a person"
                                         : "a position is rejected: " + reason +
                                               "; more of them are counted in the flight's state",
                    flight.id);
  }
  const auto origin = flight.live.origin();
  const auto& before = flight.state.origin;
  if (before && origin && EnuFrame(*before).enu_from_wgs84(*origin).m.norm() > 1e-3) {
    flight.clues_told = false;
    if (!quiet)
      deps.events.add("warning", "track.origin",
                      "the first positions were no part of the flight: its origin is another from here on",
                      flight.id);
  }
  flight.state.origin = origin;
}

void MissionService::State::publish_devices() {
  const UtcTime now = deps.clock.now();
  std::string rows = radios.rows_json(steady_now());
  if (const std::string more = deps.device_rows ? deps.device_rows() : std::string(); !more.empty())
    rows += (rows.empty() ? "" : ",") + more;
  if (!rows.empty()) deps.hub.publish(Topic::devices, '[' + rows + ']', now.us());
}

}  // namespace anchord::api
