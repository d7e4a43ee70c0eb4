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
#include "api/missions/stored_rows.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/locked.hpp"
#include "core/flight/hand_over.hpp"
#include "core/flight/live_mission.hpp"
#include "core/flight/position_watch.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/executor.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/types/geo_rings.hpp"

namespace anchord::api {

/// One followed mission: what requests leave for it, and what its strand works on. Where both are taken, the
/// work is taken first.
struct MissionService::Flight {
  Flight(flight::LiveMissionSetup setup, std::unique_ptr<Executor> on)
      : id(setup.mission.id),
        frame(setup.mission.frame),
        strand(std::move(on)),
        inbox(std::in_place, setup.mission),
        positions(std::in_place, setup.mission, setup.live.track, setup.live.origin, setup.exclusions),
        work(std::in_place, std::move(setup)) {}
  const MissionId id;
  const TrackFrame frame;
  const std::unique_ptr<Executor> strand;

  struct Inbox {
    explicit Inbox(Mission m) : mission(std::move(m)) {}
    Mission mission;
    std::deque<flight::LiveRow> queue;
    flight::RowsAhead ahead{k_max_queued_rows};
    flight::ForMission given;  ///< of its flight, since the last rows
    bool view_wanted{false};   ///< by one who does not wait: made as soon as the strand is at rest
    std::optional<LiveView> view;
    SteadyTime view_made{};
    bool scheduled{false};
    bool closing{false};       ///< finished, and what waits for a fix is not reported yet
    std::uint64_t dropped{0};  ///< rows for which the queue had no room, since all that are stored were read
    bool behind_reported{false};
    SteadyTime last_arrival{};
    SteadyTime used{};  ///< last by a sender or a reader
    /// Evicted: rows that found it before are in the store, where the next flight reads them.
    bool gone{false};
    std::optional<SteadyTime> fix_arrival{}, range_arrival{};
    /// Something is still to be done, rows that are read back apart.
    bool busy() const { return scheduled || closing || given.any() || !queue.empty(); }
  };
  Locked<Inbox> inbox;
  Locked<flight::PositionWatch> positions;  ///< held for one fix; no other lock is taken under it

  struct Work {
    explicit Work(flight::LiveMissionSetup setup) : live(std::move(setup)) {}
    flight::LiveMission live;
    std::chrono::steady_clock::time_point joint_not_before{};
    bool joint_running{false};
    std::unique_ptr<StoredRows> rebuild;  ///< while stored rows are read
    std::optional<Fix> newest_stored{};   ///< of those read
    /// Identities, sorted at the end, until the queue was worked off once.
    std::vector<std::size_t> rebuilt;
  };
  Locked<Work> work;
  std::atomic<bool> dirty{true};
  std::atomic<bool> rebuilding{false};  ///< rows wait in the queue until what was stored is in
};

/// What the service is inside: the shell round one flight::LiveMission for each mission. Its parts are in
/// mission_live.cpp (queue and strand), mission_events.cpp (what it tells, to the world),
/// mission_rebuild.cpp (what was stored, after a restart), mission_history.cpp (what was estimated when),
/// mission_joint.cpp (the joint solution in flight)
/// and mission_memory.cpp (which are in memory, and what a reader of the others gets).
struct MissionService::State : std::enable_shared_from_this<MissionService::State> {
  explicit State(Deps d) : deps(std::move(d)) {}
  Deps deps;
  struct Known {
    std::map<MissionId, Mission> cache;
    std::uint64_t forgotten{0};  ///< missions that left: what was read before is not cached after
    std::map<MissionId, std::shared_ptr<Flight>> flights;
  };
  Locked<Known> known;  ///< taken before the inbox of one of its flights
  RadioWatch radios;
  std::atomic<std::size_t> queued{0};
  std::atomic<bool> stopped{false};
  std::atomic<std::uint64_t> finished{0};
  std::atomic<MissionObserver*> observer{nullptr};
  std::condition_variable idle;
  Locked<int> running{0};  ///< tasks
  std::int64_t ticks{0};
  std::atomic<std::uint64_t> evicted{0};
  std::atomic<bool> joint_busy{false};  ///< one joint solution at a time, of whichever mission
  struct Read {
    MissionId id{};
    std::uint64_t n_ranges{}, n_fixes{};
    SteadyTime made{};
    LiveView view;
  };
  std::mutex correcting_one;
  std::mutex reading_one;          ///< one flight is read at a time: each takes the memory of a live one
  Locked<std::deque<Read>> reads;  ///< newest last
  /// What a flight estimated over time, as the body that tells it.
  struct History {
    MissionId id{};
    std::uint64_t n_ranges{}, n_fixes{};
    SteadyTime made{};
    std::shared_ptr<const std::string> text;
  };
  Locked<std::deque<History>> histories;  ///< newest last

  SteadyTime steady_now() const { return deps.steady.now(); }
  std::vector<std::shared_ptr<Flight>> all() {
    std::vector<std::shared_ptr<Flight>> out;
    const auto all = known.lock();
    for (const auto& [id, flight] : all->flights) out.push_back(flight);
    return out;
  }
  std::shared_ptr<Flight> find(const MissionId& id) {
    const auto all = known.lock();
    const auto it = all->flights.find(id);
    return it == all->flights.end() ? nullptr : it->second;
  }

  // Of Range and of Fix:
  template <class R>
  void take_newest(std::span<const R> rows);
  template <class R>
  void accept(std::span<const R> rows, std::span<const RowOutcome> outcomes);
  template <class R>
  void enqueue(Flight& flight, const R& row, SteadyTime now);
  /// Past the queue, whose strand may solve or read for seconds: where the aircraft is, to the pilot and to
  /// the page.
  void report_position(Flight& flight, const Fix& fix);
  static void report_position(Flight&, const Range&) {}
  /// A write that the live path does not wait for.
  void later(std::function<Result<void>()> write) const {
    deps.late.write(std::move(write), std::chrono::milliseconds(0));
  }
  flight::LiveRow row_of(Range range) const;
  static flight::LiveRow row_of(Fix fix) { return fix; }
  /// Poses are shown in the frame of the estimates.
  static void share_origin(Flight& flight, const Flight::Work& work);
  void schedule(const std::shared_ptr<Flight>& flight);
  void work(Flight& flight);
  static std::deque<flight::LiveRow> take_rows(Flight& flight);
  void report_dropped(Flight& flight) const;
  /// Finished, all that waited worked off, and rows are missing: nothing in the air waits for it any more.
  static bool lacks_rows(Flight& flight);
  /// From what is stored, less what is excluded now.
  void begin_anew(const std::shared_ptr<Flight>& flight);
  void make_view(Flight& flight, const Flight::Work& work) const;
  void note_radios(const flight::LiveRow& row, SteadyTime now);
  /// What the live mission reports, to the world: hub, event log, store, pilot.
  void publish_events(Flight& flight, Flight::Work& work);
  void publish_events(const Flight& flight, const std::vector<flight::PositionEvent>& events) const;
  static void publish(const Flight&, const flight::FixBelieved&) {}  // for the pilot alone
  void publish(const Flight& flight, const flight::FixShown& event) const;
  void publish(const Flight& flight, const flight::PoseMoved& event) const;
  void publish(Flight& flight, const flight::RangeDecided& event);
  void publish(Flight& flight, const flight::AnchorFound& event);
  void publish(Flight& flight, const flight::AnchorStatusChanged& event);
  void publish(Flight& flight, const flight::AnchorEstimated& event);
  void publish(Flight& flight, const flight::FixRejected& event);
  void publish(Flight& flight, const flight::OriginMoved& event);
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
  std::shared_ptr<const std::string> replayed(const Mission& mission);
  std::optional<double> length_of(const MissionId& id) const;
  static flight::LiveMission::JointProblem joint_problem(flight::LiveMission& live, const GeoRings& outline);
  GeoRings outline_of(const Mission& mission) const;
  /// Counted, so that stop() can wait for it.
  void post(Executor& on, std::function<void()> task);
  flight::LiveMissionSetup setup_of(const Mission& mission) const;
  std::vector<Exclusion> exclusions_of(const MissionId& id) const;
  void start_joint(const std::shared_ptr<Flight>& flight);
  void solve_joint(Flight& flight, const flight::LiveMission::JointProblem& problem);
  void finish_joint(Flight& flight, const FlightSolution* solution, UtcTime cut,
                    std::chrono::steady_clock::duration took, std::uint64_t generation);
  void publish_devices();
  static void take_given(Flight& flight, Flight::Work& work);
  LiveView view(Flight& flight, const Flight::Work& work) const;
  static Mission mission_of(Flight& flight) {
    const auto inbox = flight.inbox.lock();
    return inbox->mission;
  }
};

}  // namespace anchord::api
