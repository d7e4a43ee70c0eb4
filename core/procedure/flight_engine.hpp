#pragma once

#include <Eigen/Core>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/planning/next_point.hpp"
#include "core/procedure/exit_rule.hpp"
#include "core/procedure/machine.hpp"
#include "core/procedure/prior_book.hpp"
#include "core/procedure/safety.hpp"
#include "core/types/estimate.hpp"
#include "core/types/event_level.hpp"
#include "core/types/fix.hpp"
#include "core/types/plan.hpp"

namespace anchord::procedure {

/// Everything a flight is flown by. Metres of the plan's origin.
struct FlightSetup {
  Settings settings;
  SafetyLimits limits;
  ExitRule exit;
  std::map<NetworkId, double> anchor_target_sigma_m{};  ///< of anchors that have one of their own
  planning::NextPointOptions planner;
  Wgs84 origin{};
  Eigen::Vector3d middle_m{
      0, 0, 0};             ///< of the building: where an anchor is thought to be before anything is known
  planning::Walls walls{};  ///< accepted ones, which ranges go through
  std::vector<NetworkId> expected;  ///< when every one of them is done, the flight is over
  int samples = 20;                 ///< ranges wanted of each anchor at a point
  double min_gain = 0.1;            ///< share of the value; a point that brings less is not flown to
  double arrive_m = 0.5, arrive_rad = 0.25, arrive_mps = 0.4;
  double arrive_believed_m = 1.5;                   ///< the autopilot must think so as well, roughly
  double home_arrive_m = 1.5, home_arrive_mps = 1;  ///< landing does not wait for centimetres
  bool decides_apart{false};  ///< the next point is computed by whoever drives: take_point_task()

  /// When the work on this anchor ends: `exit`, with its own target where it has one.
  ExitRule exit_rule(NetworkId anchor) const;
};

/// errors  invalid_argument: no waypoint, plan nowhere, settings
Result<FlightSetup> flight_setup(const Plan& plan, const Eigen::Vector3d& home_m);

/// Height that a take-off climbs to: above where it stands, which need not be the plan's ground, and into the
/// band.
double take_off_height_m(const FlightSetup& setup);

/// What the autopilot says of itself.
struct VehicleView {
  std::optional<Eigen::Vector3d> position_m{};
  std::optional<double> heading_rad{};
  double speed_mps{};
  bool armed{false}, in_air{false};
  std::optional<double> battery{};
  int battery_warning{};           ///< the autopilot's own: 1 low, 2 critical
  std::optional<double> cell_v{};  ///< mean of the battery's cells
  /// Where it believes to be, put right by what the rover said of it lately.
  std::optional<Eigen::Vector3d> corrected_m{};
};

/// One decision and what became of it.
struct DecisionRecord {
  double time_s{};
  planning::Decision decision;
  std::optional<double> predicted{};  ///< value of the chosen point
  std::optional<double> reached{};    ///< value that the point of the decision before gave
  std::string outcome;                ///< point, no_point or done_here, with its reason
};

/// Where to measure next, to be computed: seconds with hundreds of anchors, and no round of safety waits for
/// that.
struct PointTask {
  std::uint64_t number{};
  planning::NextPointInput input;
  planning::NextPointOptions options;
};

struct Event {
  double time_s{};
  EventLevel level{};
  std::string code;
  std::string text;
  std::optional<Eigen::Vector3d> place_m{};  ///< where the aircraft is sent by it, in the plan's frame
};

/// Runs one flight: machine, guard, watch, planner and route together. Driven by calls alone: no clock, no
/// thread, no aircraft. Not thread-safe.
///
/// Every command passes refuse_command() twice: when it is laid out and again, from where the aircraft then
/// is, when it leaves.
class FlightEngine {
 public:
  explicit FlightEngine(FlightSetup setup);
  /// Goes on from a stored state: the first order is to hold.
  FlightEngine(FlightSetup setup, const State& stored, double now_s);

  void fix(double now_s, const Eigen::Vector3d& enu_m, FixClass fix);
  /// `rss_dbm` and `distance_m` where known: priors while the aircraft turns and climbs.
  void range(double now_s, NetworkId anchor, bool used, std::optional<double> rss_dbm = {},
             std::optional<double> distance_m = {});
  void vehicle(double now_s, const VehicleView& view);
  /// What the operator wants: start, hold, resume, skip, return_home, land. False: means nothing in this
  /// step.
  bool command(double now_s, Trigger trigger, const std::string& who);
  /// The pilot or a failsafe has the aircraft: alarms are told, nothing is reacted to and no time runs out.
  void taken_over(double now_s, const std::string& mode);
  void taken_back(double now_s);
  /// It was no pilot: why nothing is commanded instead.
  void explain_taken_over(double now_s, const std::string& why);
  /// Arming or take-off did not happen.
  bool not_taken_off(double now_s, const std::string& why) {
    return feed(now_s, Trigger::not_taken_off, why);
  }
  /// The present leg, or the way home, once more from where the aircraft is now.
  void repeat_leg(double now_s);
  /// At least twice a second. The estimates are looked at when a decision is due; `at_hand` false: they could
  /// not be read, and a decision, which would be one of ignorance, waits.
  void tick(double now_s, std::span<const Estimate> estimates, bool at_hand = true);
  /// Of FlightSetup::decides_apart: the decision that is due, once.
  std::optional<PointTask> take_point_task() { return std::exchange(point_task_, std::nullopt); }
  /// What came of it, for the next tick; of a task that is no longer waited for: dropped.
  void decided(std::uint64_t number, Result<planning::Decision> decision);

  /// Flies on by another plan, the aircraft being at its waypoint number `waypoint`, or on the way to it
  /// while next_is_current(): the leg is laid out anew, a decision that is due is made anew, and with other
  /// targets every anchor is assessed anew. Whether it may: core/flight/plan_change.
  void change_plan(double now_s, FlightSetup setup, std::size_t waypoint, const std::string& why);
  /// `who` ends the work on an anchor, or takes that back. False: no range of it came, or there is nothing to
  /// take back.
  bool end_work(double now_s, NetworkId anchor, AnchorOrder order, const std::string& who);
  /// The present waypoint is still to be flown to: on the way, or after a hold on it.
  bool next_is_current() const;

  std::vector<Command> take_commands();
  std::vector<Event> take_events();

  const State& state() const { return state_; }
  const FlightSetup& setup() const { return setup_; }
  const std::optional<Alarm>& alarm() const { return alarm_; }
  const std::optional<DecisionRecord>& decision() const { return decision_; }
  const std::map<NetworkId, Priors>& priors() const { return priors_.priors(); }
  std::uint64_t priors_version() const { return priors_.version(); }
  std::optional<Eigen::Vector3d> position_m() const;
  /// The target that the aircraft flies to or stands at; none while it holds, lands or takes off.
  const std::optional<Command>& leg() const { return leg_; }
  std::optional<double> distance_left_m() const;
  double elapsed_s() const;  ///< from the start to the last transition
  /// Since the start; of a flight that is over, what it took.
  double flown_s(double now_s) const {
    return started_s_ && state_.step != Step::done ? now_s - *started_s_ : state_.flown_s;
  }
  const std::map<NetworkId, std::vector<Eigen::Vector3d>>& measured_at() const { return measured_at_; }

 private:
  void apply(double now_s, const Advance& step);
  bool feed(double now_s, Trigger trigger, std::string text = {}, std::optional<Eigen::Vector3d> point = {},
            std::optional<double> heading = {});
  void execute(double now_s, const Command& command);
  void fly(double now_s, const Eigen::Vector3d& to_m, std::optional<double> heading, bool home);
  void next_leg(double now_s);
  void order(const Command& command);
  void climb(double now_s);
  bool end_of_time(double now_s, std::span<const Estimate> estimates);
  bool down(double now_s);
  void report(double now_s, EventLevel level, std::string code, std::string text,
              std::optional<Eigen::Vector3d> place_m = {});
  void monitor(double now_s);
  bool lands_by_itself() const;
  void note_lobes();
  void near_enough(NetworkId anchor, double distance_m);
  void detect_arrival(double now_s);
  void work(double now_s, std::span<const Estimate> estimates, bool at_hand);
  std::string outcome(const std::string& which) const;
  void assess_anchors(double now_s, std::span<const Estimate> estimates);
  void decide(double now_s, std::span<const Estimate> estimates);
  planning::NextPointInput point_input(std::span<const Estimate> estimates) const;
  void conclude(double now_s, Result<planning::Decision> decided);
  void finish(double now_s, Trigger trigger, std::string why);

  FlightSetup setup_;
  State state_;
  PriorBook priors_;
  VehicleView vehicle_;
  std::optional<double> vehicle_s_, vehicle_m_s_, fix_s_, good_fix_s_, started_s_;
  std::optional<double>
      watched_s_;  ///< since then it is looked after here: the start, or the restart of the server
  std::optional<Eigen::Vector3d> fix_m_;
  FixClass fix_{FixClass::none};
  std::optional<double> down_s_, climb_s_;  ///< seen on the ground and disarmed since; told to climb last
  double climb_to_m_{4};
  bool was_armed_{false}, above_floor_{false}, taken_over_{false};
  std::optional<Command> leg_;
  std::deque<Eigen::Vector3d> legs_;  ///< still to be flown to, the present one first
  std::optional<Trigger> pending_;    ///< an order was refused: fed at the next tick
  std::string pending_text_;
  std::optional<double> settled_s_;
  std::optional<Alarm> alarm_;
  std::optional<DecisionRecord> decision_;
  std::optional<PointTask> point_task_;
  std::optional<std::uint64_t> asked_;  ///< the task whose answer is waited for
  std::optional<Result<planning::Decision>> answer_;
  std::uint64_t n_tasks_{0};
  std::map<NetworkId, std::vector<Eigen::Vector3d>> measured_at_;
  std::map<NetworkId, double> distance_m_, no_lobe_m_;  ///< newest; where the turn saw no lobe
  std::vector<Command> orders_;
  std::vector<Event> events_;
};

}  // namespace anchord::procedure
