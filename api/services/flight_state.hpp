#pragma once

#include <array>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>

#include "api/application.hpp"
#include "api/json/plan_json.hpp"
#include "api/services/flight_service.hpp"
#include "api/services/interval_histogram.hpp"
#include "api/services/mission_service.hpp"
#include "core/base/guard.hpp"
#include "core/procedure/flight_control.hpp"

namespace anchord::api {

/// Alarms of procedure::watch(); the alarm board tells of their coming and going.
inline constexpr std::array<std::string_view, 5> k_flight_alarms{
    "drone.battery", "fence.breach", "drone.link", "rtk.lost", "position.disagree"};

/// One flight, in the air or just landed. Under the service's lock.
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
  std::string status() const;
  /// Why the work is over; empty while it goes on.
  std::string ended() const;
  /// The document to store, when the machine moved since the last call; empty text: forget it.
  bool to_keep(std::string& text);

  MissionId mission;
  Plan plan;
  bool manual{false};
  DroneIdentity aircraft;  ///< that it was begun with
  EnuFrame frame;          ///< of the plan, its ground at height 0
  Eigen::Vector3d home_m;
  procedure::FlightControl control;
  /// What is known of the anchors' sides: of before a restart, and of the engine since.
  procedure::FlightClues clues() const {
    return procedure::merged(clues_before, procedure::flight_clues(control.engine().clues(), frame));
  }
  procedure::FlightClues clues_before;
  std::uint64_t clues_told{0};  ///< version of the engine's clues that the mission knows
  std::string aborted;          ///< who gave the aircraft back to the pilot; empty: nobody
  double aborted_s{0};
  std::optional<planning::FlightTime> forecast{};
  std::uint64_t kept{~0ULL}, shown{~0ULL};
  double shown_s{-10};
  std::size_t shown_iteration{~std::size_t{0}};
  std::optional<Eigen::Vector3d> former_m{};  ///< manual: the last fix, for its speed
  std::optional<double> former_s{};
  procedure::VehicleView by_hand{};
};

struct FlightService::State {
  explicit State(Deps d) : deps(std::move(d)) {}

  struct Heard {
    std::optional<double> fix_s{}, fixed_since_s{}, range_s{}, correction_age_s{};
    std::optional<Fix> fix{};
  };
  struct Said {
    std::string who, reason;
  };
  /// What a checklist takes long to find out: asked before the lock is taken, never under it.
  struct Groundwork {
    const Plan* plan{nullptr};
    std::shared_ptr<const planning::PlanCheck> check;  ///< null without a plan, or when it cannot be checked
    StorageStatus storage;
  };

  double now_s() const;
  Moment moment() const {
    return {deps.clock.now(), (deps.steady != nullptr ? *deps.steady : system_steady_clock()).now()};
  }
  const ActiveFlight* flight_of(const MissionId& mission) const;
  FlightCommand* find(std::uint64_t number);
  void hear(const Fix& fix);
  void hear(const MissionId& mission, const RangeResult& result);
  Result<FlightCommand> begin(const Mission& mission, const Groundwork& ground, bool manual,
                              const Principal& who);
  Result<FlightCommand> obey(const MissionId& mission, const std::string& action, const Principal& who);
  void recover();
  void round(const MissionService::LiveView* live);
  void note_dispatched(ActiveFlight& f, FlightCommand* cause);
  void keep(const MissionId& mission, std::string document) const;
  void read_reports();
  void tell_happenings(ActiveFlight& f);
  Result<FlightCommand> obey_directly(const MissionId& mission, const std::string& action,
                                      const Principal& who);
  FlightCommand& note(const MissionId& mission, std::string action, std::string by, std::string state);
  void publish();
  void publish_soon();
  nlohmann::ordered_json procedure(const ActiveFlight& f) const;
  Groundwork groundwork(const Plan* plan);
  std::vector<ChecklistItem> checklist(const Mission* record, const MissionId& mission,
                                       const Groundwork& ground, bool manual);
  std::optional<std::string> take_off_refused(const Plan& plan, const MissionId& mission) const;
  std::vector<std::pair<std::string_view, std::string>> alarms() const;
  Result<FlightCommand> upload(const MissionId& mission, const Plan& plan, const std::string& what,
                               const std::string& who);
  const FlightUpload* uploaded(const Plan& plan, const std::string& what) const;
  void give_fence();
  std::optional<ChecklistItem> fence_item(const Plan& plan) const;

  Deps deps;
  std::mutex mutex;
  std::condition_variable wake, changed;
  Thread thread;
  bool stopping{false};
  ControlLease lease;
  std::optional<ActiveFlight> flight;
  std::map<MissionId, Heard> heard;                        ///< newest few missions only
  std::map<MissionId, std::map<std::string, Said>> said;   ///< of the checklist
  std::deque<FlightCommand> commands;                      ///< newest last, at most 30
  std::map<std::uint64_t, std::uint64_t> by_drone_number;  ///< number of the aircraft's -> ours
  std::optional<std::uint64_t> unconfirmed;                ///< of the newest command that got no answer
  std::uint64_t number{0}, newest_by_person{0};
  std::vector<FlightUpload> uploads;                    ///< the newest of each kind
  IntervalHistogram checks_apart;                       ///< of safety, while something flies
  std::optional<std::pair<MissionId, Plan>> preparing;  ///< whose checklist is being worked off

  struct Checked {
    PlanId plan{};
    std::uint64_t revision{};
    std::shared_ptr<const planning::PlanCheck> check;
  };
  std::mutex checks_mutex;
  std::deque<Checked> checks;  ///< newest last, at most 64: pages ask for the same one every second
};

}  // namespace anchord::api
