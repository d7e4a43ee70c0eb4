#pragma once

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <deque>
#include <variant>

#include "api/kit/late_writer.hpp"
#include "api/missions/mission_service.hpp"
#include "api/missions/radio_watch.hpp"
#include "api/wire/live_writer.hpp"
#include "core/flight/live_mission.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/executor.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

/// One followed mission. `queue_mutex` guards what requests touch, `work_mutex` is the strand of the rest.
struct MissionService::Flight {
  Flight(flight::LiveMissionSetup setup, std::unique_ptr<Executor> on)
      : id(setup.mission.id),
        frame(setup.mission.frame),
        strand(std::move(on)),
        mission(setup.mission),
        live(std::move(setup)) {}
  const MissionId id;
  const TrackFrame frame;
  const std::unique_ptr<Executor> strand;
  std::mutex queue_mutex;
  Mission mission;  ///< under queue_mutex
  std::deque<flight::LiveRow> queue;
  flight::RowsAhead ahead{k_max_queued_rows};
  std::optional<procedure::FlightClues> new_clues;
  bool view_wanted{false};  ///< by one who does not wait: made as soon as the strand is at rest
  std::optional<LiveView> view;
  SteadyTime view_made{};
  bool scheduled{false};
  bool closing{false};  ///< finished, and what waits for a fix is not told yet
  std::uint64_t dropped{0};
  SteadyTime last_arrival{};
  SteadyTime used{};  ///< last by a sender or a reader
  bool gone{
      false};  ///< evicted: rows that found it before are in the store, where the next flight reads them
  std::optional<SteadyTime> fix_arrival{}, range_arrival{};
  std::mutex work_mutex;  ///< the strand: everything below
  flight::LiveMission live;
  std::atomic<bool> dirty{true};
  std::chrono::steady_clock::time_point joint_not_before{};
  bool joint_running{false};

  std::atomic<bool> rebuilding{false};  ///< rows wait in the queue until what was stored is in
  struct Rebuild {
    MeasurementStore::Filter range_filter{}, fix_filter{};
    std::deque<Range> ranges;
    std::deque<Fix> fixes;
    bool more_ranges{true}, more_fixes{true};
  };
  std::unique_ptr<Rebuild> rebuild;
  bool busy() const;
  std::vector<std::size_t> rebuilt;  ///< identities, sorted at the end, until the queue was worked off once
};

/// What the service is inside: the shell round one flight::LiveMission for each mission. Its parts are in
/// mission_live.cpp (queue and strand), mission_events.cpp (what it tells, to the world),
/// mission_rebuild.cpp (what was stored, after a restart), mission_joint.cpp (the joint solution in flight)
/// and mission_memory.cpp (which are in memory, and what a reader of the others gets).
struct MissionService::State : std::enable_shared_from_this<MissionService::State> {
  explicit State(Deps d) : deps(std::move(d)) {}
  Deps deps;
  std::mutex mutex;
  std::map<MissionId, Mission> cache;
  std::uint64_t forgotten{0};  ///< missions that left: what was read before is not cached after
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
  std::atomic<std::uint64_t> evicted{0};
  std::atomic<bool> joint_busy{false};  ///< one joint solution at a time, of whichever mission
  struct Read {
    MissionId id{};
    std::uint64_t n_ranges{}, n_fixes{};
    SteadyTime made{};
    LiveView view;
  };
  std::mutex reading_mutex;  ///< one flight is read at a time: each takes the memory of a live one
  std::mutex reads_mutex;
  std::deque<Read> reads;  ///< newest last

  SteadyTime steady_now() const { return deps.steady.now(); }
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

  // Of Range and of Fix:
  template <class R>
  void take_newest(std::span<const R> rows);
  template <class R>
  void accept(std::span<const R> rows, std::span<const RowOutcome> outcomes);
  template <class R>
  void enqueue(Flight& flight, const R& row, SteadyTime now);
  /// A write that the live path does not wait for.
  void later(std::function<Result<void>()> write) const {
    deps.late.write(std::move(write), std::chrono::milliseconds(0));
  }
  flight::LiveRow row_of(Range range) const;
  static flight::LiveRow row_of(Fix fix) { return fix; }
  void schedule(const std::shared_ptr<Flight>& flight);
  void work(Flight& flight);
  void note_radios(const flight::LiveRow& row);
  /// What the live mission tells, to the world: hub, event log, store, pilot. Under its work_mutex.
  void tell_events(Flight& flight);
  void tell(Flight& flight, const flight::FixBelieved& event);
  void tell(Flight& flight, const flight::FixShown& event);
  void tell(Flight& flight, const flight::PoseMoved& event);
  void tell(Flight& flight, const flight::RangeDecided& event);
  void tell(Flight& flight, const flight::AnchorFound& event);
  void tell(Flight& flight, const flight::AnchorStatusChanged& event);
  void tell(Flight& flight, const flight::AnchorEstimated& event);
  void tell(Flight& flight, const flight::FixRejected& event);
  void tell(Flight& flight, const flight::OriginMoved& event);
  void begin_rebuild(const std::shared_ptr<Flight>& flight);
  void continue_rebuild(const std::shared_ptr<Flight>& flight);
  void start_reading(Flight& flight) const;
  void end_rebuild(Flight& flight);
  bool rebuild_slice(Flight& flight);
  void evict();
  bool take_out(Flight& flight);
  std::optional<LiveView> read(const MissionId& id);
  std::optional<LiveView> read_before(const Read& now);
  void forget_reads(const std::optional<MissionId>& id);
  static flight::LiveMission::JointProblem joint_problem(Flight& flight, const std::string& outline);
  std::string outline_of(const Mission& mission) const;
  /// Counted, so that stop() can wait for it.
  void post(Executor& on, std::function<void()> task);
  flight::LiveMissionSetup setup_of(const Mission& mission) const;
  std::vector<Exclusion> exclusions_of(const MissionId& id) const;
  void start_joint(const std::shared_ptr<Flight>& flight);
  void solve_joint(Flight& flight, const flight::LiveMission::JointProblem& problem);
  void finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                    std::chrono::steady_clock::duration took, std::uint64_t generation);
  void publish_devices();
  static void take_clues(Flight& flight);
  LiveView view(Flight& flight) const;  ///< under its work_mutex
};

}  // namespace anchord::api
