#pragma once

#include <Eigen/Core>
#include <array>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/result.hpp"
#include "core/flight/checklist.hpp"
#include "core/flight/command.hpp"
#include "core/flight/control_lease.hpp"
#include "core/flight/flown_time.hpp"
#include "core/flight/measured_time.hpp"
#include "core/flight/plan_change.hpp"
#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"
#include "core/ports/drone.hpp"
#include "core/procedure/flight_control.hpp"
#include "core/procedure/flight_priors.hpp"
#include "core/types/fix.hpp"
#include "core/types/live_event.hpp"
#include "core/types/mission.hpp"
#include "core/types/plan.hpp"

namespace anchord {
struct RangeResult;
}  // namespace anchord

namespace anchord::flight {

/// Alarms of procedure::watch(); the alarm board logs their coming and going.
inline constexpr std::array<std::string_view, 5> k_flight_alarms{
    "drone.battery", "fence.breach", "drone.link", "rtk.lost", "position.disagree"};

/// Now, as whoever drives a flight sees it: `s` is what the procedure runs on.
struct Now : Moment {
  double s{};
};

/// A line of the event log.
struct LogEvent {
  EventLevel level{};
  std::string code;
  std::string text;
  std::optional<MissionId> mission{};
  std::optional<EventPlace> place{};
};

/// What became of a flight's plan since the start.
struct FlownChanges {
  std::uint64_t n{0};
  UtcTime at{};                               ///< of the last one
  std::string by;                             ///< who took it
  std::optional<Plan> former;                 ///< the plan before it, for undo
  std::optional<KeptPlace> kept;              ///< the waypoint that was worked at when it was taken
  std::optional<DroneFence> autopilot_keeps;  ///< given on the ground, not to be changed in the air
  bool own_origin{true};                      ///< the stored plan has one; else the take-off gave it
  std::uint64_t saved_revision{0};            ///< newest that is stored of the plan; 0: none since the start
  std::uint64_t n_anchor_orders{0};  ///< anchors accepted, given up or reopened by hand since the start
};

/// One flight, in the air or just landed.
struct ActiveFlight {
  ActiveFlight(const MissionId& m, Plan p, bool by_pilot, EnuFrame f, Eigen::Vector3d home,
               procedure::FlightControl c)
      : mission(m),
        plan(std::move(p)),
        manual(by_pilot),
        frame(std::move(f)),
        home_m(std::move(home)),
        control(std::move(c)) {}

  bool flying() const;
  FlightStatus status() const;
  /// Why the work is over; empty while it goes on.
  std::string ended() const;
  /// Of one that has ended; nothing while it goes on.
  std::optional<FlownTime> flown_time() const;
  /// What is known of the anchors' sides: of before a restart, and of the engine since.
  procedure::FlightPriors priors() const {
    return procedure::merged(priors_before, procedure::flight_priors(control.engine().priors(), frame));
  }

  MissionId mission;
  Plan plan;  ///< that is flown; changes of it in flight: operations_plans.cpp
  FlownChanges changes;
  bool manual{false};
  DroneIdentity aircraft;  ///< that it was begun with
  EnuFrame frame;          ///< of the plan, its ground at height 0
  Eigen::Vector3d home_m;
  procedure::FlightControl control;
  procedure::FlightPriors priors_before;
  std::string aborted;  ///< who gave the aircraft back to the pilot; empty: nobody
  double aborted_s{0};
  std::optional<planning::FlightTime> forecast{};           ///< of the plan that is flown now
  std::optional<planning::FlightTime> forecast_at_start{};  ///< of the plan that was started
  std::optional<Eigen::Vector3d> former_m{};                ///< manual: the last fix, for its speed
  std::optional<double> former_s{};
  procedure::VehicleView by_hand{};
};

/// A flight of before a restart, as it was kept.
struct KeptFlight {
  MissionId mission{};
  Plan plan;  ///< with its origin
  bool manual{false};
  Eigen::Vector3d home_m{0, 0, 0};
  procedure::State state;
  procedure::FlightPriors priors;
  DroneIdentity aircraft;  ///< system 0: not said
  FlownChanges changes;
  std::optional<planning::FlightTime> forecast_at_start{};
};

/// What a checklist takes long to find out: asked before, by whoever drives.
struct Groundwork {
  const Plan* plan{nullptr};
  std::shared_ptr<const planning::PlanCheck> check;  ///< null without a plan, or when it cannot be checked
  bool writable{true};
  double disk_free_bytes{};
};

/// Everything round the one aircraft: control lease, checklist, the one calibration flight with its procedure
/// and safety, commands and what became of them, lists given to the autopilot, alarms.
///
/// Deterministic: driven by calls that bring their time; commands go to the Drone, which is asked for its
/// status and its reports, and what happened is taken as events. No clock, thread, lock or output. Not
/// thread-safe.
class Operations {
 public:
  /// `drone` null: flights are flown by hand. `decides_apart`: whoever drives computes the next point and
  /// need not do it in a round; else rounds do.
  explicit Operations(Drone* drone, bool decides_apart = false)
      : drone_(drone), decides_apart_(decides_apart) {}

  // Inputs. Fixes and ranges count from when they were measured (MeasuredTime).
  void fix(const Now& now, const Fix& fix);
  void range(const Now& now, const MissionId& mission, const RangeResult& result);
  /// About ten times a second: reports read, safety, procedure, commands. `live`: running estimates in metres
  /// of `origin`, where they are at hand.
  struct Estimates {
    Wgs84 origin;
    std::vector<Estimate> estimates;
  };
  void round(const Now& now, const std::optional<Estimates>& live, bool at_hand);
  /// A decision that is due, and its answer, which the next round reads.
  struct PointTask : procedure::PointTask {
    std::uint64_t flight{};  ///< n_flights() when it was asked
  };
  std::optional<PointTask> take_point_task();
  void decided(const PointTask& task, Result<planning::Decision> decision);
  /// Goes on with a flight of before a restart: hold first.
  /// errors: of the plan
  Result<void> recover(const Now& now, KeptFlight kept);
  /// The server stops: an aircraft in the air that we fly stands.
  void halt();

  // What an operator asks. errors: conflict (another has control), invalid_argument (the state forbids it)
  Result<Lease> take_control(const Now& now, const MissionId& mission, const Holder& who, bool by_force,
                             std::string key);
  Result<Lease> renew_control(const Now& now, const MissionId& mission, const std::string& key,
                              const Holder& who) {
    return lease_.renew(mission, key, who, now);
  }
  Result<void> release_control(const Now& now, const MissionId& mission, const std::string& key,
                               const Holder& who);
  /// Of a token that opens nothing any more.
  void end_control(const Now& now, const std::string& token_id);
  std::optional<Lease> control(const Now& now) const { return lease_.holder(now); }
  Result<FlightCommand> begin(const Now& now, const Mission& mission, const Groundwork& ground, bool manual,
                              const std::string& who);
  /// Any but start, which is begin().
  Result<FlightCommand> act(const Now& now, const MissionId& mission, FlightAction action,
                            const std::string& who);
  /// Of a change of the plan in flight; none: this mission is not the one that is flown.
  std::optional<ChangeBasis> change_basis(const Now& now, const MissionId& mission) const;
  /// Flies on by what was proposed on that basis. False: the flight has moved on since, propose anew.
  /// errors  invalid_argument: refused, with every reason
  Result<bool> take_plan(const Now& now, const MissionId& mission, const ChangeBasis& basis,
                         const PlanProposal& proposal, const std::string& who);
  /// FlightEngine::end_work(), in flight.
  /// errors  invalid_argument: not flown, or of that anchor nothing came, or there is nothing to take back
  Result<void> order_anchor(const Now& now, const MissionId& mission, NetworkId anchor,
                            procedure::AnchorOrder order, const std::string& who);
  /// A revision was stored that is not flown, should a flight fly this plan.
  void plan_saved(const PlanId& plan, const std::string& name, std::uint64_t revision);
  Result<FlightCommand> upload(const Now& now, const MissionId& mission, const Plan& plan,
                               const std::string& what, const std::string& who);
  Result<DroneStatus> change_aircraft(const MissionId& mission, const std::string& sender,
                                      const std::string& who);
  std::vector<ChecklistItem> checklist(const Now& now, const Mission* record, const MissionId& mission,
                                       const Groundwork& ground, bool manual) const;
  Result<void> override_item(const Now& now, const MissionId& mission, const std::string& item,
                             const std::string& reason, const std::string& who, const Groundwork& ground);
  /// Somebody who may fly works off this checklist: the aircraft gets the plan's fence.
  void prepare(const MissionId& mission, const Plan& plan) { preparing_.emplace(mission, plan); }

  // What there is.
  const std::optional<ActiveFlight>& flight() const { return flight_; }
  const ActiveFlight* flight_of(const MissionId& mission) const {
    return flight_ && flight_->mission == mission ? &*flight_ : nullptr;
  }
  std::uint64_t n_flights() const { return n_flights_; }  ///< begun or recovered so far
  bool flying() const { return flight_ && flight_->flying(); }
  const std::deque<FlightCommand>& commands() const { return commands_; }  ///< newest last, at most 60
  const FlightCommand* command(std::uint64_t number) const;
  std::uint64_t newest_by_person() const { return newest_by_person_; }
  const std::vector<FlightUpload>& uploads() const { return uploads_; }
  /// Every alarm a flight can raise, with what is wrong now; empty: nothing is.
  std::vector<std::pair<std::string_view, std::string>> alarms() const;
  std::optional<DroneStatus> drone() const;

  std::vector<LogEvent> take_events() { return std::exchange(events_, {}); }
  /// True once after something changed that a screen shows and no transition reports.
  bool take_shown_soon() { return std::exchange(show_soon_, false); }

 private:
  /// Of the newest measurements of one mission, by the clock of Now::s.
  struct Received {
    MeasuredTime fixes, ranges;
    std::optional<double> fix_s{}, fixed_since_s{}, range_s{}, correction_age_s{};
    std::optional<Fix> fix{};
    std::optional<NetworkId> unknown_tag{};  ///< of the newest range, where the mission does not have it
  };
  struct Override {
    std::string who, reason;
  };
  FlightCommand* find(std::uint64_t number);
  FlightCommand& note(const Now& now, const MissionId& mission, std::string_view action, std::string by);
  void note_dispatched(const Now& now, ActiveFlight& f, FlightCommand* cause);
  void read_reports(const Now& now);
  void take_events(ActiveFlight& f);
  FlightCommand act_directly(const Now& now, const MissionId& mission, FlightAction action,
                             const std::string& who);
  void give_fence(const Now& now);
  std::optional<std::string> take_off_refused(const Plan& plan, const MissionId& mission) const;
  std::optional<DroneFence> fence_given(const Plan& plan) const;
  const FlightUpload* uploaded(const Plan& plan, const std::string& what) const;
  std::optional<ChecklistItem> fence_item(const Plan& plan) const;
  void log_event(EventLevel level, std::string code, std::string text, std::optional<MissionId> mission,
                 std::optional<EventPlace> place = {}) {
    events_.push_back({level, std::move(code), std::move(text), std::move(mission), place});
  }

  Drone* drone_;
  bool decides_apart_;
  ControlLease lease_;
  std::optional<ActiveFlight> flight_;
  std::map<MissionId, Received> received_;                           ///< newest few missions only
  std::map<MissionId, std::map<std::string, Override>> overridden_;  ///< of the checklist
  std::deque<FlightCommand> commands_;
  std::map<std::uint64_t, std::uint64_t> by_drone_number_;  ///< number of the aircraft's -> ours
  std::optional<std::uint64_t> unconfirmed_;                ///< of the newest command that got no answer
  std::uint64_t number_{0}, newest_by_person_{0}, n_flights_{0};
  std::vector<FlightUpload> uploads_;                    ///< the newest of each kind
  std::optional<std::pair<MissionId, Plan>> preparing_;  ///< whose checklist is being worked off
  std::vector<LogEvent> events_;
  bool show_soon_{false};
};

}  // namespace anchord::flight
