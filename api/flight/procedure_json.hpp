#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/flight/checklist.hpp"
#include "core/flight/command.hpp"
#include "core/geo/enu.hpp"
#include "core/planning/local_plan.hpp"
#include "core/ports/drone.hpp"
#include "core/procedure/flight_engine.hpp"
#include "core/procedure/flight_priors.hpp"

namespace anchord::api {

using flight::ChecklistItem;
using flight::FlightCommand;
using flight::FlightUpload;

nlohmann::ordered_json drone_json(const DroneStatus& drone);
nlohmann::ordered_json flight_command_json(const FlightCommand& command);
nlohmann::ordered_json flight_upload_json(const FlightUpload& upload);
nlohmann::ordered_json checklist_json(const std::vector<ChecklistItem>& items);

/// The message of topic `procedure`, as plain values: copied while a flight is locked, written when it no
/// longer is.
struct ProcedureView {
  MissionId mission{};
  std::string plan;  ///< id, or empty
  std::string name;  ///< of the plan
  std::uint64_t plan_revision{};
  std::uint64_t saved_revision{};                ///< newest stored since the start; 0: none
  std::optional<std::uint64_t> undo_revision{};  ///< of the plan before a change in flight
  std::uint64_t plan_changes{};
  std::string mode;  ///< auto, manual
  flight::FlightStatus status{};
  std::string ended;  ///< why the work is over, empty while it goes on
  std::optional<planning::FlightTime> forecast{};
  std::int64_t t_us{};
  double now_s{};
  std::optional<DroneStatus> drone{};
  std::optional<Eigen::Vector3d> shift_m{};  ///< rover minus autopilot
  std::optional<std::string> holder{};
  std::int64_t holder_since_us{}, holder_until_us{};
  std::vector<FlightCommand> commands;

  procedure::State state;
  /// What is known beside its task; one for each of state.anchors, in their order.
  struct Anchor {
    std::optional<double> target_sigma_m{}, bearing_rad{}, height_m{};
    std::optional<bool> height_at_edge{};
  };
  std::vector<Anchor> anchors;
  std::optional<Wgs84> target{};  ///< of state.target_m
  std::optional<double> target_sigma_m{}, distance_m{}, battery_needed{};
  double elapsed_s{};
  std::size_t n_waypoints{};
  int k{};
  std::optional<procedure::Alarm> alarm{};
};
/// What the engine knows, into the view; `view.now_s` is set.
void read_engine(const procedure::FlightEngine& engine, const EnuFrame& frame, ProcedureView& view);
nlohmann::ordered_json procedure_json(const ProcedureView& view);
/// Topic mission.grid: the last decision with every candidate. A copy of what it is made of, since it is long
/// to write.
struct GridView {
  MissionId mission{};
  std::int64_t t_us{};
  planning::Rule rule{};
  planning::Combine combine{};
  std::vector<Eigen::Vector3d> visited, unreachable;
  std::optional<procedure::DecisionRecord> decision;
  EnuFrame frame;
};
nlohmann::ordered_json grid_json(const GridView& view);
/// Topics mission.turn and mission.height of one anchor.
nlohmann::ordered_json turn_json(const MissionId& mission, NetworkId anchor, std::int64_t t_us,
                                 const procedure::Priors& priors, bool running);
nlohmann::ordered_json height_json(const MissionId& mission, NetworkId anchor, std::int64_t t_us,
                                   const procedure::Priors& priors, bool running);

/// The machine's state as it is kept, and back. errors: a document of another shape gives nothing.
nlohmann::ordered_json stored_state(const procedure::State& state);
std::optional<procedure::State> state_of(const nlohmann::json& json);

/// Priors as they are kept with the mission, and back; entries of another shape are left out.
nlohmann::ordered_json stored_priors(const procedure::FlightPriors& priors);
procedure::FlightPriors priors_of(const nlohmann::json& json);
/// Those of a whole kept document, also of one that an older server wrote.
procedure::FlightPriors priors_in_document(const nlohmann::json& document);

}  // namespace anchord::api
