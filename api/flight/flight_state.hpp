#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <variant>

#include "api/flight/flight_service.hpp"
#include "api/flight/interval_histogram.hpp"
#include "api/flight/kept_outcome.hpp"
#include "api/flight/procedure_json.hpp"
#include "api/kit/storage_status.hpp"
#include "api/missions/mission_service.hpp"
#include "api/planning/plan_json.hpp"
#include "api/stream/hub.hpp"
#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/flight/hand_over.hpp"
#include "core/flight/operations.hpp"

namespace anchord::api {

/// The shell round flight::Operations: thread, clocks, lock; what is shown (flight_show.cpp) and kept
/// (flight_kept.cpp).
struct FlightService::State {
  explicit State(Deps d) : deps(std::move(d)), work(std::in_place, deps.drone, !deps.now_s) {}

  /// What a round asks for that takes long with hundreds of anchors: done beside it, never in it.
  struct Apart {
    std::optional<flight::Operations::PointTask> point;
    bool grid{false}, profiles{false};
    bool handed_over{false};  ///< to the executor, and not done
    bool any() const { return point || grid || profiles; }
    void drop() {
      point.reset();
      grid = profiles = false;
    }
  };
  /// What of the present flight was kept and shown; each flight begins anew.
  struct Last {
    std::uint64_t flight{0}, kept{~0ULL}, shown{~0ULL};
    double shown_s{-10}, profiles_s{-10};
    double logged_decision_s{-10}, logged_profiles_s{-10};
    std::uint64_t logged_changes{~0ULL};  ///< of the plan
    std::optional<Topic> growing{};       ///< of the profiles that grew when they were last shown
    bool flew{false};
  };
  /// What rounds, requests and measurements share. No disk, no estimate, no JSON, no message and nothing long
  /// while it is held: values are copied, and written without it.
  struct Work {
    Work(Drone* drone, bool decides_apart) : operations(drone, decides_apart) {}
    flight::Operations operations;
    Apart apart;
    Last last;
    flight::HandOver hand_over;
    std::vector<MissionId> landed;  ///< not asked for yet
    bool stopping{false};
  };
  using Guard = Locked<Work>::Exclusive;

  flight::Now now() const;
  /// What happened since the last call, to the event log, in its order whoever calls. Without the lock.
  void publish_events();
  /// An operator's or a round's act under the lock, and then what happened by it.
  template <class Act>
  auto operate(Act act) {
    const auto acted = [&] {
      auto w = work.lock();
      return act(w->operations, now());
    };
    auto out = acted();
    publish_events();
    return out;
  }
  /// Whether what is due apart has to be handed to the executor (by the caller, without the lock).
  static bool apart_is_due(Work& w);
  /// All that is due, with the lock given away meanwhile.
  void work_apart();
  bool piece_apart(Guard& w);
  static void decide(Guard& w);
  flight::Groundwork groundwork(const Plan* plan);
  Result<Plan> wanted_plan(const MissionId& mission, bool undo);
  void recover();
  using ToKeep = std::variant<flight::KeptFlight, KeptOutcome>;
  /// What to store, when the machine moved since the last call.
  static std::optional<ToKeep> to_keep(Work& w, const flight::ActiveFlight& f);
  static void note_landing(Work& w, const flight::ActiveFlight& f);
  template <class Part>
  Part outcome(const MissionId& mission, Part KeptOutcome::*part);
  void keep(const MissionId& mission, const ToKeep& what) const;
  static FlownPlan flown_by(const flight::ActiveFlight& f);
  static ProcedureView procedure(const flight::Now& at, const flight::Operations& operations,
                                 const flight::ActiveFlight& f);
  /// What is to be shown after a round.
  struct Due {
    std::optional<ProcedureView> procedure{};
    bool logged{false};                 ///< the procedure, for a replay too
    std::optional<FlownPlan> plan{};    ///< for a replay, as it began or was changed
    bool grid{false}, profiles{false};  ///< apart, once the procedure was
  };
  static Due due(Work& w, const flight::Now& at);
  void publish(const Due& due) const;
  /// For a replay, whenever the disk has time for it.
  void log(const MissionId& mission, std::int64_t t_us, std::string_view topic,
           std::vector<std::string> messages) const;
  void show_grid(Guard& w) const;
  static std::optional<Topic> take_grown(Last& last, procedure::Step step, double now_s);
  void show_profiles(Guard& w) const;

  Deps deps;
  std::mutex publishing_;  ///< events, in their order; taken before the work
  Locked<Work> work;
  std::condition_variable wake, changed, idle;
  Thread thread;
  IntervalHistogram checks_apart;  ///< of safety, while something flies

  struct Checked {
    PlanId plan{};
    std::uint64_t revision{}, structure{};
    std::shared_ptr<const planning::PlanCheck> check;
  };
  Locked<std::deque<Checked>> checks;  ///< newest last, at most 64: pages ask for the same one every second
};

}  // namespace anchord::api
