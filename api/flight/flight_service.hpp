#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "api/kit/message.hpp"
#include "api/missions/mission_control.hpp"
#include "api/missions/mission_observer.hpp"
#include "core/base/result.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"
#include "core/flight/checklist.hpp"
#include "core/flight/command.hpp"
#include "core/flight/control_lease.hpp"
#include "core/flight/flown_time.hpp"
#include "core/flight/plan_change.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/types/fix.hpp"
#include "core/types/plan.hpp"

namespace anchord {
class Drone;
class Executor;
class PlanStore;
class ProcedureLog;
}  // namespace anchord

namespace anchord::api {

class EventLog;
class Hub;
class LateWriter;
class MissionService;
class SiteStructures;
struct StorageStatus;

using flight::ChecklistItem;
using flight::FlightCommand;
using flight::FlightUpload;
using flight::Lease;

/// The one calibration flight that may be in the air: lease, checklist, procedure, commands, restart.
///
/// Runs FlightEngine ten times a second on its own thread from fixes, ranges and the aircraft's telemetry;
/// its orders go to the Drone, or, without one, to the pilot's screen. Thread-safe.
class FlightService final : public MissionObserver, public MissionControl {
 public:
  struct Deps {
    MissionService& missions;
    PlanStore& plans;
    ProcedureLog& procedure_log;
    SiteStructures& structures;
    Hub& hub;
    EventLog& events;
    const Clock& clock;
    const SteadyClock& steady;  ///< what the lease runs on
    Executor& plan;             ///< what of a flight is long to compute or to write
    LateWriter& late;
    Drone* drone{nullptr};  ///< null: flown by hand ("manual")
    std::function<StorageStatus()> storage;
    std::function<bool(const std::string& token_id)> ended;  ///< revoked or expired
    std::function<double()> now_s{};  ///< steady seconds; set: no thread, the owner calls step()
  };
  explicit FlightService(Deps deps);
  ~FlightService() override;

  /// Goes on with what a killed server was flying (hold first), then runs.
  void start();
  /// Tells an aircraft in the air to hold, joins.
  void stop();
  void step();  ///< one round: telemetry, engine, orders, messages

  void on_fix(const Fix& fix) override;
  void on_range(const MissionId& mission, const RangeResult& result) override;

  // errors of all: not_found (no such mission), conflict (no control, or another's), invalid_argument
  Result<Lease> take_control(const MissionId& mission, const Principal& who, bool by_force);
  Result<Lease> renew_control(const MissionId& mission, const std::string& key,
                              const Principal& who) override;
  Result<void> release_control(const MissionId& mission, const std::string& key,
                               const Principal& who) override;
  std::optional<Lease> control();
  /// Whether this mission's flight is in the air; and which mission flies this plan.
  bool flies(const MissionId& mission) override;
  std::optional<MissionId> flown_with(const PlanId& plan);
  /// Of the flight that is flown, or was flown last.
  std::optional<MissionId> mission() const;
  /// What the plan that the mission is or was flown by wants of its anchors; empty: none, flown by hand.
  PlanTargets targets(const MissionId& mission);
  /// How long its newest flight took beside its forecast; nothing in the air, and where none was.
  std::optional<flight::FlownTime> flown_time(const MissionId& mission);
  /// Missions whose flight has ended on the ground since the last call: what was to be measured is.
  std::vector<MissionId> take_landed();

  struct Order {
    flight::FlightAction action{};
    std::string lease;
    std::optional<PlanId> plan{};  ///< of start
    bool manual{false};            ///< of start: a pilot flies, although there is an aircraft to command
  };
  /// What the service makes of an order: its first state is known at once, its fate within 2 s.
  /// errors  conflict: no control (type no-control); invalid_argument: the state forbids it (type state)
  Result<FlightCommand> act(const MissionId& mission, const Order& order, const Principal& who);
  /// Waits until the command is no longer `sent`, at most so long.
  FlightCommand settled(FlightCommand command, double wait_s);

  /// Gives the aircraft on the ground the plan's fence or its route to keep; `what`: fence, route. Its fate
  /// comes as a command's.
  /// errors  conflict: no control; invalid_argument: no aircraft, in the air, nothing to give; not_found:
  /// plan
  Result<FlightCommand> upload(const MissionId& mission, const std::string& what, const PlanId& plan,
                               const std::string& lease, const Principal& who);
  /// What is flown, and how it came to be; the plan has the origin of the flight.
  struct FlownPlan {
    Plan plan;
    std::uint64_t n_changes{};
    UtcTime changed{};
    std::string changed_by;
    std::uint64_t saved_revision{};                ///< 0: none since the start
    std::optional<std::uint64_t> former_revision;  ///< that undo goes back to
  };
  /// errors  not_found: no such mission, or it has not been flown since the server started
  Result<FlownPlan> flown_plan(const MissionId& mission);
  /// A change of the plan in flight: to the revision that is stored, or back to the one flown before.
  struct PlanOrder {
    bool undo{false};
    std::string lease{};                         ///< of take
    std::optional<std::uint64_t> revision{};     ///< that a person has seen the difference of
    std::optional<std::size_t> next_waypoint{};  ///< and from where it was to be flown; from 1
  };
  struct PlanDifference {
    Plan before;
    flight::PlanProposal proposal;
  };
  /// As it would be taken now; nothing changes by asking.
  /// errors  not_found; invalid_argument: not flown, nothing to undo
  Result<PlanDifference> plan_difference(const MissionId& mission, const PlanOrder& order);
  /// errors  conflict: no control; invalid_argument: refused, with every reason; or another revision, or
  /// another next waypoint, than the person has seen
  Result<PlanDifference> take_plan(const MissionId& mission, const PlanOrder& order, const Principal& who);
  /// In flight: ends the work on an anchor, or takes that back. Only a position with the verdict ok is
  /// accepted. errors  conflict: no control; invalid_argument: not flown, no range of it, not ok, nothing to
  /// take back
  Result<void> order_anchor(const MissionId& mission, NetworkId anchor, procedure::AnchorOrder order,
                            const std::string& lease, const Principal& who);
  /// A revision of a plan was stored.
  void plan_saved(const Plan& plan);

  /// Newest of each kind.
  std::vector<FlightUpload> uploads(const MissionId& mission);

  /// The aircraft on the link is another one: that of `sender`, or, empty, the next whose autopilot is heard.
  /// errors  conflict: no control; invalid_argument: no link, or the aircraft that flies answers
  Result<DroneStatus> change_aircraft(const MissionId& mission, const std::string& lease,
                                      const std::string& sender, const Principal& who);

  /// What must be green before Start; sends nothing.
  std::vector<ChecklistItem> checklist(const MissionId& mission, const std::optional<PlanId>& plan);
  /// This plan is to be flown: the aircraft gets its fence, as soon as it is there and on the ground, unless
  /// somebody has control of another mission.
  /// errors  not_found: no such plan; what joining its structures says
  Result<void> prepare(const MissionId& mission, const PlanId& plan);
  /// A manual item is confirmed, an automatic one overridden; the reason is kept with the name.
  Result<void> override_item(const MissionId& mission, const std::string& item, const std::string& reason,
                             const Principal& who);

  /// Bodies of the topics and of their GET counterparts; empty: this mission has no flight.
  std::string procedure_text(const MissionId& mission);
  std::string grid_text(const MissionId& mission);
  std::vector<std::string> turn_texts(const MissionId& mission);
  std::vector<std::string> height_texts(const MissionId& mission);
  /// Every alarm a flight can raise, with what is wrong now; empty: nothing is.
  std::vector<std::pair<std::string_view, std::string>> alarms();
  /// Time between two checks of procedure and safety of a flight in the air, in Prometheus text.
  std::string metrics() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
