#include "api/services/mission_service.hpp"

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <variant>

#include "api/json/live_writer.hpp"
#include "api/live/hub.hpp"
#include "api/services/event_log.hpp"
#include "api/services/flight_watch.hpp"
#include "api/services/joint_worker.hpp"
#include "api/services/live_row.hpp"
#include "api/services/mission_observer.hpp"
#include "api/services/radio_watch.hpp"
#include "core/localize/flight_history.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/live_flight.hpp"
#include "core/ports/store.hpp"

namespace anchord::api {
namespace {

using Row = LiveRow;
constexpr std::int64_t k_pose_interval_us = 100'000;  // 10 Hz of measurement time
constexpr std::int64_t k_rtk_interval_us = 200'000;

constexpr std::size_t k_min_joint_ranges = 100;  // below, the own search of each anchor is as good
constexpr auto k_joint_pause = std::chrono::seconds(2);

}  // namespace

struct MissionService::Flight {
  explicit Flight(const Mission& m) : id(m.id), frame(m.frame), mission(m), live(m) {}
  const MissionId id;
  const TrackFrame frame;
  std::mutex queue_mutex;
  Mission mission;  ///< under queue_mutex
  std::deque<Row> queue;
  bool scheduled{false};
  std::uint64_t dropped{0};
  UtcTime last_arrival{};
  std::optional<UtcTime> fix_arrival{}, range_arrival{};
  std::mutex work_mutex;  ///< the strand: everything below
  LiveFlight live;
  std::map<NetworkId, std::string> statuses;
  MissionLiveState state;
  std::int64_t last_pose_us{0}, last_rtk_us{0};
  std::deque<std::int64_t> range_times_us;
  std::atomic<bool> dirty{true};
  FlightHistory history;
  std::size_t ranges_since_joint{0};
  std::chrono::steady_clock::time_point joint_not_before{};
  bool joint_running{false};

  FlightWatch watch;
  std::atomic<bool> rebuilding{false};  ///< rows wait in the queue until what was stored is in
  struct Rebuild {
    MeasurementStore::Filter range_filter{}, fix_filter{};
    std::deque<Range> ranges;
    std::deque<Fix> fixes;
    bool more_ranges{true}, more_fixes{true};
  };
  std::unique_ptr<Rebuild> rebuild;
  std::vector<std::size_t> rebuilt;  ///< identities, sorted at the end, until the queue was worked off once
};

struct MissionService::State : std::enable_shared_from_this<MissionService::State> {
  explicit State(Deps d) : deps(std::move(d)) {}
  Deps deps;
  std::mutex mutex;
  std::map<MissionId, Mission> cache;
  std::map<MissionId, std::shared_ptr<Flight>> flights;
  RadioWatch radios;
  std::atomic<std::size_t> queued{0};
  std::atomic<bool> stopped{false};
  std::atomic<std::uint64_t> finished{0};
  std::atomic<MissionObserver*> observer{nullptr};
  std::mutex running_mutex;
  std::condition_variable idle;
  int running{0};
  std::int64_t ticks{0};
  JointWorker joint;

  std::vector<std::shared_ptr<Flight>> all() {
    std::vector<std::shared_ptr<Flight>> out;
    const std::scoped_lock lock(mutex);
    for (const auto& [id, flight] : flights) out.push_back(flight);
    return out;
  }
  std::shared_ptr<Flight> find(const MissionId& id) {
    const std::scoped_lock lock(mutex);
    const auto it = flights.find(id);
    return it == flights.end() ? nullptr : it->second;
  }

  template <class R>
  void accept(std::vector<R> rows);
  Row row_of(Range range) const;
  static Row row_of(Fix fix) { return fix; }
  void schedule(const std::shared_ptr<Flight>& flight);
  void work(Flight& flight);
  void step(Flight& flight, const Row& row, bool quiet);
  void announce(Flight& flight, bool quiet);
  void publish_pose(Flight& flight);
  void begin_rebuild(const std::shared_ptr<Flight>& flight);
  void continue_rebuild(const std::shared_ptr<Flight>& flight);
  bool rebuild_slice(Flight& flight);
  void post(std::function<void()> task);
  void start_joint(const std::shared_ptr<Flight>& flight);
  void finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                    std::chrono::steady_clock::duration took);
  void publish_devices();
};

MissionService::MissionService(Deps deps) : state_(std::make_shared<State>(std::move(deps))) {}
MissionService::~MissionService() { stop(); }

void MissionService::observe(MissionObserver* observer) { state_->observer = observer; }

Result<Mission> MissionService::mission(const MissionId& id) {
  {
    const std::scoped_lock lock(state_->mutex);
    const auto it = state_->cache.find(id);
    if (it != state_->cache.end()) return it->second;
  }
  BOOST_OUTCOME_TRY(auto mission, state_->deps.missions.mission(id));
  const std::scoped_lock lock(state_->mutex);
  if (state_->cache.size() > 1000) state_->cache.clear();
  state_->cache[id] = mission;
  return mission;
}

Result<void> MissionService::create(const Mission& mission) {
  BOOST_OUTCOME_TRY(state_->deps.missions.insert(mission));
  prepare(mission.id);
  state_->deps.events.add("info", "mission.started", mission.name + " started", mission.id);
  if (const auto flight = state_->find(mission.id)) {
    const std::scoped_lock lock(flight->work_mutex);
    state_->deps.hub.publish(Topic::mission_state, mission_state_json(mission, flight->state),
                             mission.created.us(), to_string(mission.id));
  }
  return boost::outcome_v2::success();
}

Result<Mission> MissionService::finish(const MissionId& id) {
  BOOST_OUTCOME_TRY(auto current, state_->deps.missions.mission(id));
  if (current.state == MissionState::finished)
    return make_error(Errc::conflict, current.name + " is finished already");
  current.state = MissionState::finished;
  current.finished = state_->deps.clock.now();
  BOOST_OUTCOME_TRY(state_->deps.missions.update(current));
  ++state_->finished;
  {
    const std::scoped_lock lock(state_->mutex);
    state_->cache[id] = current;
  }
  if (const auto flight = state_->find(id)) {
    {
      const std::scoped_lock lock(flight->queue_mutex);
      flight->mission = current;
    }
    flight->dirty = true;
  }
  state_->deps.events.add("info", "mission.finished", current.name + " finished", id);
  return current;
}

Result<void> MissionService::remove(const MissionId& id) {
  BOOST_OUTCOME_TRY(state_->deps.missions.remove(id));
  const std::scoped_lock lock(state_->mutex);
  state_->cache.erase(id);
  state_->flights.erase(id);
  for (const Topic topic : {Topic::mission_state, Topic::drone_pose, Topic::rtk_status})
    state_->deps.hub.forget(topic, to_string(id));
  return boost::outcome_v2::success();
}

void MissionService::prepare(const MissionId& id) {
  if (state_->find(id)) return;
  const auto record = mission(id);
  if (!record) return;
  auto flight = std::make_shared<Flight>(record.value());
  flight->state.time = record.value().created;
  // Told before it can be found: rows that come meanwhile wait in the queue.
  flight->rebuilding = true;
  {
    const std::scoped_lock lock(state_->mutex);
    if (!state_->flights.emplace(id, flight).second) return;
  }
  state_->begin_rebuild(flight);
}

void MissionService::State::begin_rebuild(const std::shared_ptr<Flight>& flight) {
  const auto n = deps.measurements.count_ranges(flight->id),
             fixes = deps.measurements.count_fixes(flight->id);
  if (!n || !fixes || n.value() + fixes.value() == 0) {
    flight->rebuilding = false;
    return schedule(flight);
  }
  {
    const std::scoped_lock lock(flight->work_mutex);
    flight->rebuild = std::make_unique<Flight::Rebuild>();
    auto& r = *flight->rebuild;
    r.range_filter.mission = r.fix_filter.mission = flight->id;
    r.range_filter.limit = r.fix_filter.limit = 2000;
    r.range_filter.with_cir = deps.judge_needs_cir && deps.judge_needs_cir();
    flight->live.hold(true);
  }
  continue_rebuild(flight);
}

void MissionService::State::continue_rebuild(const std::shared_ptr<Flight>& flight) {
  post([self = shared_from_this(), flight] {
    if (self->stopped) return;
    if (self->rebuild_slice(*flight)) return self->continue_rebuild(flight);
    flight->rebuilding = false;
    self->schedule(flight);
  });
}

/// Two sorted streams merged by time, a page of each in memory; one page of either a call. False at the end.
bool MissionService::State::rebuild_slice(Flight& flight) {
  const std::scoped_lock lock(flight.work_mutex);
  auto& r = *flight.rebuild;
  bool failed = false;
  const auto refill = [&](auto& rows, auto& filter, bool& more, auto read) {
    if (!rows.empty() || !more) return;
    auto page = read(filter);
    failed = failed || !page;
    if (!page) return;
    for (auto& row : page.value().rows) rows.push_back(std::move(row));
    filter.after = page.value().next;
    more = !filter.after.empty();
  };
  refill(r.ranges, r.range_filter, r.more_ranges, [&](auto& f) { return deps.measurements.ranges(f); });
  refill(r.fixes, r.fix_filter, r.more_fixes, [&](auto& f) { return deps.measurements.fixes(f); });
  const auto take = [&](auto& rows) {
    const Row row = row_of(std::move(rows.front()));
    rows.pop_front();
    flight.rebuilt.push_back(identity(row));
    step(flight, row, true);
  };
  while (!failed && !(r.ranges.empty() && r.fixes.empty())) {
    // A stream that has run dry in the middle waits for its next page.
    if ((r.ranges.empty() && r.more_ranges) || (r.fixes.empty() && r.more_fixes)) return true;
    if (r.fixes.empty() || (!r.ranges.empty() && r.ranges.front().time < r.fixes.front().time))
      take(r.ranges);
    else
      take(r.fixes);
  }
  flight.rebuild.reset();
  std::ranges::sort(flight.rebuilt);
  flight.live.hold(false);
  announce(flight, true);
  publish_pose(flight);
  flight.dirty = true;
  return false;
}

void MissionService::State::start_joint(const std::shared_ptr<Flight>& flight) {
  if (stopped || flight->rebuilding || !joint.idle()) return;
  Mission mission;
  {
    const std::scoped_lock lock(flight->queue_mutex);
    mission = flight->mission;
  }
  const std::unique_lock lock(flight->work_mutex, std::try_to_lock);
  if (!lock || flight->joint_running || flight->ranges_since_joint == 0) return;
  const auto now = std::chrono::steady_clock::now();
  if (flight->history.n_ranges() < k_min_joint_ranges || now < flight->joint_not_before) return;
  JointWorker::Task task;
  task.flight = flight->history.data(mission);
  task.options.origin = flight->live.origin();
  if (flight->frame == TrackFrame::wgs84 && !task.options.origin) return;
  task.done = [self = this, flight, cut = flight->history.newest(), now](const FlightSolution* solution) {
    self->finish_joint(*flight, solution, cut, std::chrono::steady_clock::now() - now);
  };
  // Set before the worker can be done.
  flight->joint_running = true;
  flight->ranges_since_joint = 0;
  if (!joint.try_start(std::move(task))) flight->joint_running = false, flight->ranges_since_joint = 1;
}

void MissionService::State::finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                                         std::chrono::steady_clock::duration took) {
  const std::scoped_lock lock(flight.work_mutex);
  flight.joint_running = false;
  // Three times as long a pause as the solution took: a quarter of one core at most, however long the flight.
  flight.joint_not_before = std::chrono::steady_clock::now() +
                            std::max<std::chrono::steady_clock::duration>(k_joint_pause, 3 * took);
  if (solution == nullptr || stopped) return;
  flight.live.adopt(*solution, cut);
  flight.watch.note_lag(solution->shared.lag_s.value, solution->shared.lag_s.sigma);
  announce(flight, false);
  flight.dirty = true;
}

Row MissionService::State::row_of(Range range) const {
  JudgedRange row{std::move(range), {}, {}};
  row.time = row.range.time;
  if (deps.judge) row.model = deps.judge(row.range);
  row.range.cir.reset();  // a queued row needs none, and it is 4 kB
  return row;
}

template <class R>
void MissionService::State::accept(std::vector<R> rows) {
  const UtcTime now = deps.clock.now();
  std::shared_ptr<Flight> flight;
  for (auto& row : rows) {
    if (!flight || flight->id != row.mission) flight = find(row.mission);
    if (!flight) continue;
    Row judged = row_of(std::move(row));
    const std::scoped_lock lock(flight->queue_mutex);
    flight->last_arrival = now;
    (std::is_same_v<R, Fix> ? flight->fix_arrival : flight->range_arrival) = now;
    if (flight->queue.size() >= k_max_queued_rows) {
      flight->queue.pop_front();
      ++flight->dropped;
      --queued;
    }
    flight->queue.push_back(std::move(judged));
    ++queued;
  }
  for (const auto& f : all()) schedule(f);
}

bool MissionService::wants_cir() const {
  return state_->deps.judge_needs_cir && state_->deps.judge_needs_cir();
}

void MissionService::note_in_flights(const std::string& code, const std::string& text) {
  std::vector<MissionId> recording;
  {
    const std::scoped_lock lock(state_->mutex);
    for (const auto& [id, flight] : state_->flights) {
      const std::scoped_lock queue(flight->queue_mutex);
      if (flight->mission.state == MissionState::recording) recording.push_back(id);
    }
  }
  for (const auto& id : recording) state_->deps.events.add("info", code, text, id);
}

void MissionService::accepted(std::vector<Range> ranges) { state_->accept(std::move(ranges)); }
void MissionService::accepted(std::vector<Fix> fixes) { state_->accept(std::move(fixes)); }

void MissionService::State::schedule(const std::shared_ptr<Flight>& flight) {
  {
    const std::scoped_lock lock(flight->queue_mutex);
    if (flight->scheduled || flight->queue.empty() || stopped || flight->rebuilding) return;
    flight->scheduled = true;
  }
  post([self = shared_from_this(), flight] {
    if (!self->stopped) self->work(*flight);
    bool again = false;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      flight->scheduled = false;
      again = !flight->queue.empty();
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
    task();
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
  std::deque<Row> rows;
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
  std::size_t since_announced = 0;
  for (const auto& row : rows) {
    if (!flight.rebuilt.empty() && std::ranges::binary_search(flight.rebuilt, identity(row))) continue;
    step(flight, row, false);
    if (++since_announced == 100) {
      announce(flight, false);
      since_announced = 0;
    }
  }
  announce(flight, false);
  publish_pose(flight);
  flight.dirty = true;
  const std::scoped_lock queue(flight.queue_mutex);
  if (flight.queue.empty()) flight.rebuilt = {};
}

void MissionService::State::step(Flight& flight, const Row& row, bool quiet) {
  auto& state = flight.state;
  const UtcTime time = time_of(row);
  if (!state.started || time < *state.started) state.started = time;
  if (!(time < state.time) || state.n_ranges + state.n_fixes == 0) state.time = time;
  if (const auto* judged = std::get_if<JudgedRange>(&row)) {
    const Range* range = &judged->range;
    ++state.n_ranges;
    if (!quiet) {
      const UtcTime now = deps.clock.now();
      radios.heard(range->tag, range->kind == RangeKind::tag_anchor, time, now);
      radios.heard(range->anchor, false, time, now);
    }
    flight.range_times_us.push_back(time.us());
    if (flight.range_times_us.size() > 100) flight.range_times_us.pop_front();
    const double span_s =
        static_cast<double>(flight.range_times_us.back() - flight.range_times_us.front()) * 1e-6;
    state.range_rate_hz = span_s > 0 ? static_cast<double>(flight.range_times_us.size() - 1) / span_s : 0;
    flight.watch.note_range(time);
    flight.history.add(corrected(*judged));
    ++flight.ranges_since_joint;
    flight.live.add(*range, judged->model);
    return;
  }
  const auto& fix = std::get<Fix>(row);
  ++state.n_fixes;
  flight.watch.note(fix);
  flight.history.add(fix);
  flight.live.add(fix);
  if (quiet) return;
  if (auto* told = observer.load()) told->on_fix(fix);
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
      const auto anchor = deps.anchors.find_or_create(estimate.anchor, deps.clock.now());
      if (!quiet && anchor)
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
  flight.state.origin = flight.live.origin();
  flight.state.anchors_found = flight.statuses.size();
  flight.state.anchors_converged =
      static_cast<std::size_t>(std::count_if(flight.statuses.begin(), flight.statuses.end(),
                                             [](const auto& entry) { return entry.second == "converged"; }));
}

void MissionService::State::publish_devices() {
  const UtcTime now = deps.clock.now();
  std::string rows = radios.rows_json(now);
  if (const std::string more = deps.device_rows ? deps.device_rows() : std::string(); !more.empty())
    rows += (rows.empty() ? "" : ",") + more;
  if (!rows.empty()) deps.hub.publish(Topic::devices, '[' + rows + ']', now.us());
}

std::vector<MissionService::LiveView> MissionService::live(const std::optional<MissionId>& id) {
  std::vector<std::shared_ptr<Flight>> wanted;
  if (id) {
    prepare(*id);
    if (auto flight = state_->find(*id)) wanted.push_back(std::move(flight));
  } else {
    // After a restart nothing is followed yet: bring back the newest flights that still record.
    if (const auto newest = state_->deps.missions.missions(5, std::nullopt)) {
      for (const auto& mission : newest.value()) {
        if (mission.state == MissionState::recording) prepare(mission.id);
      }
    }
    const std::scoped_lock lock(state_->mutex);
    for (const auto& [mission, flight] : state_->flights) wanted.push_back(flight);
  }
  std::vector<LiveView> out;
  for (const auto& flight : wanted) {
    Mission mission;
    {
      const std::scoped_lock lock(flight->queue_mutex);
      mission = flight->mission;
    }
    const std::scoped_lock lock(flight->work_mutex);
    out.push_back({std::move(mission), flight->live.origin(), flight->live.estimates()});
    for (auto& estimate : out.back().estimates) judge_goal(estimate, state_->deps.goal);
  }
  return out;
}

void MissionService::tick() {
  for (const auto& flight : state_->all()) {
    state_->start_joint(flight);
    if (!flight->dirty) continue;
    const std::unique_lock lock(flight->work_mutex, std::try_to_lock);
    if (!lock) continue;  // at work: the next tick tells
    flight->dirty = false;
    Mission mission;
    {
      const std::scoped_lock queue(flight->queue_mutex);
      mission = flight->mission;
    }
    state_->deps.hub.publish(Topic::mission_state, mission_state_json(mission, flight->state),
                             flight->state.time.us(), to_string(mission.id));
  }
  if (++state_->ticks % 2 == 0) state_->publish_devices();
}

std::uint64_t MissionService::finished() const { return state_->finished; }

std::vector<FlightPulse> MissionService::pulses() {
  const UtcTime now = state_->deps.clock.now();
  const auto steady = std::chrono::steady_clock::now();
  std::vector<FlightPulse> out;
  for (const auto& flight : state_->all()) {
    if (flight->rebuilding) continue;
    const std::unique_lock work(flight->work_mutex, std::try_to_lock);
    if (!work) continue;  // at work: rows come, nothing is silent
    const std::scoped_lock lock(flight->queue_mutex);
    if (flight->mission.state != MissionState::recording) continue;
    FlightPulse pulse = flight->watch.look(flight->state.time, steady);
    pulse.mission = flight->id;
    pulse.name = flight->mission.name;
    pulse.now = now;
    pulse.fix_arrival = flight->fix_arrival;
    pulse.range_arrival = flight->range_arrival;
    out.push_back(std::move(pulse));
  }
  return out;
}

std::size_t MissionService::queued() const { return state_->queued; }

bool MissionService::recording() const {
  const UtcTime now = state_->deps.clock.now();
  const std::scoped_lock lock(state_->mutex);
  return std::any_of(state_->flights.begin(), state_->flights.end(), [&](const auto& entry) {
    const std::scoped_lock queue(entry.second->queue_mutex);
    return entry.second->mission.state == MissionState::recording &&
           seconds_between(entry.second->last_arrival, now) < 5;
  });
}

void MissionService::stop() {
  state_->stopped = true;
  state_->joint.stop();
  std::unique_lock lock(state_->running_mutex);
  // Tasks the pool never ran (it was stopped first) must not hold the shutdown up for ever.
  state_->idle.wait_for(lock, std::chrono::seconds(5), [&] { return state_->running == 0; });
}

}  // namespace anchord::api
