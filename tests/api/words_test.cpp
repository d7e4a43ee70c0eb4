// Each word of a request becomes the value of its name, whatever the order of the enum behind it; and the
// words of the contract are those of the tables.
#include <gtest/gtest.h>

#include <cctype>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "api/admin/alarm_rules.hpp"
#include "api/admin/cir_retention.hpp"
#include "api/anchors/frame_json.hpp"
#include "api/calibration/calibration_service.hpp"
#include "api/calibration/datum_change.hpp"
#include "api/exchange/anchor_drawing.hpp"
#include "api/formats/plan_export.hpp"
#include "api/kit/contract.hpp"
#include "api/kit/message.hpp"
#include "api/learning/freeze_rows.hpp"
#include "api/learning/measurement_query.hpp"
#include "api/learning/model_signer.hpp"
#include "api/measurements/flight_requests.hpp"
#include "api/missions/mission_json.hpp"
#include "api/omlox/omlox_zone.hpp"
#include "api/places/structure_json.hpp"
#include "api/stream/hub.hpp"
#include "api/webhooks/cloud_event.hpp"
#include "core/flight/command.hpp"
#include "core/flight/control_lease.hpp"
#include "core/flight/flown_time.hpp"
#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/image_head.hpp"
#include "core/localize/accuracy_goal.hpp"
#include "core/ml/recipe.hpp"
#include "core/planning/local_plan.hpp"
#include "core/planning/plan_change.hpp"
#include "core/ports/procedure_log.hpp"
#include "core/procedure/machine.hpp"
#include "core/procedure/safety.hpp"
#include "core/types/event_level.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/wall.hpp"
#include "core/types/webhook.hpp"
#include "drivers/device/supervisor.hpp"

namespace anchord::api::words_test {
namespace {

using Json = nlohmann::json;

FlightOptions asked(const char* key, const Json& value) {
  std::vector<FieldError> errors;
  const Json body{{"missions", {"0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}}, {key, value}};
  auto request = read_calibration_request(body, errors);
  EXPECT_TRUE(errors.empty()) << key << " " << value << ": " << (errors.empty() ? "" : errors.front().detail);
  return request.options;
}

TEST(CalibrationRequestWords, NameTheSolver) {
  EXPECT_EQ(asked("solver", "gauss_newton").method, anchord::Method::gauss_newton);
  EXPECT_EQ(asked("solver", "levenberg_marquardt").method, anchord::Method::levenberg_marquardt);
  EXPECT_EQ(asked("solver", "dogleg").method, anchord::Method::dogleg);
}

TEST(CalibrationRequestWords, NameWeightsAndLoss) {
  EXPECT_EQ(asked("weights", "inverse_variance").weights, Weights::inverse_variance);
  EXPECT_EQ(asked("weights", "dissertation").weights, Weights::as_printed);
  EXPECT_EQ(asked("loss", {{"type", "none"}}).loss, Loss::none);
  EXPECT_EQ(asked("loss", {{"type", "huber"}}).loss, Loss::huber);
  EXPECT_EQ(asked("loss", {{"type", "cauchy"}}).loss, Loss::cauchy);
  EXPECT_EQ(asked("loss", {{"type", "tukey"}}).loss, Loss::tukey);
}

TEST(CalibrationRequestWords, NameTheLeastFix) {
  EXPECT_EQ(asked("min_fix", "none").min_fix, FixClass::none);
  EXPECT_EQ(asked("min_fix", "single").min_fix, FixClass::single);
  EXPECT_EQ(asked("min_fix", "dgps").min_fix, FixClass::dgps);
  EXPECT_EQ(asked("min_fix", "float").min_fix, FixClass::rtk_float);
  EXPECT_EQ(asked("min_fix", "fixed").min_fix, FixClass::rtk_fixed);
}

TEST(CalibrationRequestWords, DeclareHowWellTheLeverArmWasMeasured) {
  EXPECT_EQ(asked("lever_arm_sigma_m", 0.02).lever_arm_sigma_m, 0.02);
  EXPECT_FALSE(asked("dims", 3).lever_arm_sigma_m.has_value());
  for (const Json& refused : {Json(0), Json(-0.1), Json(11), Json("0.02")}) {
    std::vector<FieldError> errors;
    read_calibration_request(
        Json{{"missions", {"0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}}, {"lever_arm_sigma_m", refused}}, errors);
    ASSERT_EQ(errors.size(), 1u) << refused;
    EXPECT_EQ(errors.front().pointer, "/lever_arm_sigma_m");
  }
}

TEST(MissionFields, DeclareHowWellTheLeverArmWasMeasured) {
  const auto declared = [](const std::optional<Json>& sigma, std::vector<FieldError>& errors) {
    Json body{{"name", "n"}, {"frame", "wgs84"}, {"track_point", "body"}, {"tags", Json::array()}};
    if (sigma) body["lever_arm_sigma_m"] = *sigma;
    return read_mission(body, errors);
  };
  std::vector<FieldError> none;
  for (const double sigma_m : {0.001, 0.02, 10.0}) {
    const Mission mission = declared(sigma_m, none);
    EXPECT_EQ(mission.lever_arm_sigma_m, sigma_m);
    EXPECT_EQ(mission_json(mission, {}, {})["lever_arm_sigma_m"], sigma_m);
    EXPECT_EQ(parse_mission(mission_json(mission, {}, {}).dump()).value().lever_arm_sigma_m, sigma_m);
    EXPECT_EQ(read_mission(Json::parse(mission_request_json(mission)), none).lever_arm_sigma_m, sigma_m);
  }
  for (const auto& nothing : {std::optional<Json>(), std::optional<Json>(nullptr)}) {
    const Mission mission = declared(nothing, none);
    EXPECT_FALSE(mission.lever_arm_sigma_m.has_value());
    EXPECT_TRUE(mission_json(mission, {}, {})["lever_arm_sigma_m"].is_null());
    EXPECT_FALSE(parse_mission(mission_json(mission, {}, {}).dump()).value().lever_arm_sigma_m.has_value());
    EXPECT_FALSE(Json::parse(mission_request_json(mission)).contains("lever_arm_sigma_m"));
  }
  EXPECT_TRUE(none.empty());
  for (const Json& refused : {Json(0), Json(0.0009), Json(-0.1), Json(10.1), Json("0.02"), Json(true)}) {
    std::vector<FieldError> errors;
    declared(refused, errors);
    ASSERT_EQ(errors.size(), 1u) << refused;
    EXPECT_EQ(errors.front().pointer, "/lever_arm_sigma_m");
  }
  // Of a server of before.
  const auto before =
      parse_mission(R"({"name":"n","frame":"local","track_point":"body","tags":[],"state":"finished"})");
  ASSERT_TRUE(before) << before.error().message;
  EXPECT_FALSE(before.value().lever_arm_sigma_m.has_value());
}

TEST(CalibrationRequestWords, RefuseAnotherWordWithThoseThereAre) {
  std::vector<FieldError> errors;
  read_calibration_request(Json{{"missions", {"0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f"}}, {"solver", "newton"}},
                           errors);
  ASSERT_EQ(errors.size(), 1u);
  EXPECT_EQ(errors.front().pointer, "/solver");
  EXPECT_EQ(errors.front().detail, "must be one of gauss_newton, levenberg_marquardt, dogleg");
}

/// The enums of strings of one contract, by where they are: "Schema.property.property",
/// "GET /api/v1/ranges ?fix", "?Label" of a parameter that several share.
void walk(const Json& node, const std::string& at, std::map<std::string, Json>& out) {
  if (node.is_array()) {
    for (const auto& one : node) walk(one, at, out);
    return;
  }
  if (!node.is_object()) return;
  if (const auto words = node.find("enum");
      words != node.end() && words->is_array() && words->front().is_string())
    out[at] = *words;
  for (const auto& [key, value] : node.items()) {
    if (key == "properties") {
      for (const auto& [name, property] : value.items()) walk(property, at + "." + name, out);
    } else if (key == "parameters" && value.is_array()) {
      for (const auto& one : value) walk(one, at + " ?" + one.value("name", ""), out);
    } else if (key != "enum" && key != "example" && key != "examples") {
      walk(value, at, out);
    }
  }
}

std::map<std::string, Json> enums_of_openapi() {
  std::map<std::string, Json> out;
  const auto contract = Json::parse(openapi_json());
  const auto& components = contract.at("components");
  // The words of OGC API Features are those of its standard.
  for (const auto& [name, schema] : components.at("schemas").items())
    if (!name.starts_with("Ogc")) walk(schema, name, out);
  for (const auto& [name, one] : components.at("parameters").items()) walk(one, "?" + name, out);
  for (const auto& [path, methods] : contract.at("paths").items()) {
    if (path.starts_with("/ogc")) continue;
    for (const auto& [method, operation] : methods.items()) {
      std::string upper(method);
      for (char& c : upper) c = static_cast<char>(std::toupper(c));
      walk(operation, upper + " " + path, out);
    }
  }
  return out;
}

std::map<std::string, Json> enums_of_asyncapi() {
  std::map<std::string, Json> out;
  const auto contract = Json::parse(asyncapi_json());
  // The words of omlox are those of its standard.
  for (const auto& [name, message] : contract.at("components").at("messages").items())
    if (!name.starts_with("omlox")) walk(message, name, out);
  return out;
}

Json topic_names() {
  Json out = Json::array();
  for (const auto& topic : topics()) out.push_back(topic.name);
  return out;
}

/// What the procedure shows.
Json procedure_topic_names() {
  Json out{k_log_plan};
  for (const auto topic : {Topic::procedure, Topic::mission_grid, Topic::mission_turn, Topic::mission_height})
    out.push_back(info(topic).name);
  return out;
}

template <class T, std::size_t N>
Json words(const EnumTable<T, N>& table) {
  return std::vector<std::string>(table.words().begin(), table.words().end());
}
template <class T, std::size_t N>
Json words(std::vector<std::string> first, const EnumTable<T, N>& table) {
  first.insert(first.end(), table.words().begin(), table.words().end());
  return first;
}
template <class T, std::size_t N>
Json words(const EnumTable<T, N>& table, const char* last) {
  auto out = words(table);
  out.push_back(last);
  return out;
}

/// Every enum of the contract is the table of the code, or is said here to have none behind it.
void expect_the_same(const std::map<std::string, Json>& contract, const std::map<std::string, Json>& tables,
                     const std::set<std::string>& without) {
  for (const auto& [at, enumerated] : contract) {
    if (without.contains(at)) continue;
    const auto table = tables.find(at);
    if (table == tables.end())
      ADD_FAILURE() << "enum " << at
                    << " of the contract: name its table in this test, or say that it has none";
    else
      EXPECT_EQ(enumerated, table->second) << at;
  }
  for (const auto& [at, table] : tables)
    EXPECT_TRUE(contract.contains(at)) << at << " is not in the contract";
  for (const auto& at : without) EXPECT_TRUE(contract.contains(at)) << at << " is not in the contract";
}

std::set<std::string> words_without_a_table() {
  return {// formats, orders and counts of one route
          "?Sort", "GET /api/v1/ranges ?format", "GET /api/v1/ranges ?count", "GET /api/v1/fixes ?format",
          "GET /api/v1/ranges/{id}/cir ?format", "GET /api/v1/plans/{id}/export ?format",
          "GET /api/v1/anchors ?view", "GET /api/v1/anchors ?format",
          "GET /api/v1/campaigns/{id}/samples ?format", "GET /api/v1/calibrations/{id}/residuals ?format",
          "GET /api/v1/campaigns/{id}/samples/{sample}/cir ?format", "GET /api/v1/datasets/{id}/rows ?format",
          "GET /api/v1/signing-key ?format",
          // texts that are chosen where they are written
          "FlightUpload.what", "UploadRequest.what", "Checklist.items.state", "FlightAircraft.others.kind",
          "DeviceWrite.kind", "SiteWrite.crs.base.source", "ModelGate.checks.basis",
          "PositionDiff.items.change", "DatasetCreate.split.by", "DatasetRules.positive", "DatasetRow.split",
          "TrainingRunCreate.select.metric", "TrainingConfusion.positive", "TrainingPrediction.split",
          "GET /api/v1/training-runs/{id}/predictions ?split", "Me.auth", "System.clock.source",
          "System.mqtt.state", "FloorPlanGeoreference.source", "LiveEstimate.status"};
}

/// What is counted of a site is a part of what is counted of an organization.
Json quota_words(std::size_t kinds) {
  const Json all = words(k_quota_kind_words);
  return Json(std::vector<Json>(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(kinds)));
}

std::map<std::string, Json> tables_of_receivers() {
  return {
      {"WebhookRequest.events", Json(k_webhook_events)},    {"WebhookChange.events", Json(k_webhook_events)},
      {"WebhookRequest.kind", words(k_webhook_kind_words)}, {"Webhook.kind", words(k_webhook_kind_words)},
      {"Delivery.state", words(k_delivery_words)},          {"OmloxDialect", words(k_dialect_words)},
  };
}

TEST(WireWords, AreThoseOfOpenApi) {
  std::map<std::string, Json> tables{
      {"Exclusion.kind", words(k_row_kind_words)},
      {"ProcedureLogEntry.topic", procedure_topic_names()},
      {"ExclusionRequest.kind", words(k_row_kind_words)},
      {"FixClass", words(k_fix_words)},
      {"GET /api/v1/plans/{id}/export ?autopilot", words(k_autopilot_words)},
      {"GET /api/v1/ranges ?fix", words(k_fix_words)},
      {"ConfiguredDevice.rover.fix", words(k_fix_words)},
      {"Verdict", words(k_verdict_words)},
      {"GET /api/v1/anchors ?height", words(k_file_height_words)},
      {"GET /api/v1/exports/anchors.dxf ?height", words(k_file_height_words)},
      {"GET /api/v1/exports/anchors.ifc ?height", words(k_file_height_words)},
      {"GET /api/v1/exports/anchors-pnezd.csv ?height", words(k_file_height_words)},
      {"MissionCreate.frame", words(k_frame_words)},
      {"Mission.frame", words(k_frame_words)},
      {"Calibration.frame", words(k_frame_words)},
      {"MissionCreate.track_point", words(k_point_words)},
      {"Mission.track_point", words(k_point_words)},
      {"MissionCorrection.track_point", words(k_point_words)},
      {"Mission.state", words(k_mission_state_words)},
      {"FlightTime.against_forecast", words(flight::k_against_forecast_words)},
      {"AnchorGoal.source", words(k_goal_source_words)},
      {"POST /api/v1/missions/{id}/cir-archive.to", words(api::k_cirs_to_words)},
      {"SiteQuota.reached", quota_words(k_quota_kinds)},
      {"OrganizationQuota.reached", quota_words(k_organization_quota_kinds)},
      {"MissionAction.action", words({"finish", "take_devices"}, flight::k_flight_action_words)},
      {"MissionAction.mode", words(flight::k_flight_mode_words)},
      {"Procedure.mode", words(flight::k_flight_mode_words)},
      {"Procedure.status", words(flight::k_flight_status_words)},
      {"Procedure.step", words(procedure::k_step_words)},
      {"Procedure.alarm.reaction", words(procedure::k_reaction_words)},
      {"PlanDifference.waypoints.change", words(planning::k_changed_words)},
      {"PlanDifference.areas.area", words(planning::k_area_words)},
      {"PlanDifference.areas.change", words(planning::k_changed_words)},
      {"FlightCommand.state", words(k_command_state_words)},
      {"ControlAction.action", words(flight::k_control_words)},
      {"AnchorOrder.action", words(procedure::k_anchor_order_words)},
      {"Grid.rule", words(planning::k_rule_words)},
      {"PlanSettings.rule", words(planning::k_rule_words)},
      {"Grid.combine", words(planning::k_combine_words)},
      {"PlanSettings.combine", words(planning::k_combine_words)},
      {"PlanIssue.severity", words(planning::k_severity_words)},
      {"RangeIn.kind", words(k_range_kind_words)},
      {"HeardRadio.kind", words(k_radio_words)},
      {"ConfiguredDevice.state", words({"off"}, device::k_phase_words)},
      {"Alarm.priority", words(k_alarm_priority_words)},
      {"Job.state", words(k_job_state_words)},
      {"TrainingRun.state", words(k_job_state_words)},
      {"Space", words(k_space_words)},
      {"ErrorBudget.largest", words(k_error_source_words)},
      {"ErrorBudget.help", words(k_budget_help_words)},
      {"CalibrationCreate.solver", words(k_solver_words)},
      {"CalibrationCreate.weights", words(k_weights_words)},
      {"CalibrationCreate.loss.type", words(k_loss_words)},
      {"CalibrationCreate.initial", words(k_initial_words)},
      {"DatumWrite.helmert.convention", words(k_rotation_words)},
      {"CalibrationCreate.profile", words(k_profile_words)},
      {"CalibrationCreate.models.correction", words(ml::k_correction_words)},
      {"CalibrationCreate.models.likelihood", words(k_likelihood_words)},
      {"CalibrationCreate.models.worth", words(k_worth_words)},
      {"Predict.correction", words(ml::k_correction_words)},
      {"ActiveModels.correction", words(ml::k_correction_words)},
      {"ActiveModelsPatch.correction", words(ml::k_correction_words)},
      {"ModelStanding", words(k_standing_words)},
      {"LearningTask", words(ml::k_task_words)},
      {"TrainingRunCreate.engine", words(ml::k_engine_words)},
      {"TrainingRunCreate.cv.group_by", words(k_place_words, "session")},
      {"GET /api/v1/datasets/{id}/rules ?group_by", words(k_place_words)},
      {"DatasetCreate.aggregation", words(k_aggregation_words)},
      {"PredictedClass.class", words(k_predicted_words)},
      {"?PredictedClass", words(k_predicted_words)},
      {"?Label", words(k_label_words)},
      {"TokenCreate.roles", words(k_role_words)},
      {"Event.level", words(k_event_level_words)},
      {"Floor.plan.media_type", words(floor_plan::k_image_format_words)},
      {"FloorPlanGeoreference.model", words(floor_plan::k_fit_model_words)},
      {"GeoreferenceWrite.model", words(floor_plan::k_fit_model_words)},
      {"FloorWalls.walls.material", words(k_wall_material_words)},
      {"FloorWallsWrite.walls.material", words(k_wall_material_words)},
      {"FloorWallsWrite.material", words(k_wall_material_words)},
  };
  tables.merge(tables_of_receivers());
  expect_the_same(enums_of_openapi(), tables, words_without_a_table());
}

TEST(WireWords, AreThoseOfAsyncApi) {
  const std::map<std::string, Json> tables{
      {"topic.alarms.priority", words(k_alarm_priority_words)},
      {"topic.anchors_estimates.verdict", words(k_verdict_words)},
      {"topic.drone_pose.fix", words(k_fix_words)},
      {"topic.fixes.fix", words(k_fix_words)},
      {"topic.rtk_status.fix", words(k_fix_words)},
      {"topic.events.level", words(k_event_level_words)},
      {"topic.jobs.state", words(k_job_state_words)},
      {"topic.mission_state.state", words(k_mission_state_words)},
      {"topic.mission_state.frame", words(k_frame_words)},
      {"topic.mission_grid.rule", words(planning::k_rule_words)},
      {"topic.mission_grid.combine", words(planning::k_combine_words)},
      {"topic.procedure.mode", words(flight::k_flight_mode_words)},
      {"topic.procedure.status", words(flight::k_flight_status_words)},
      {"topic.procedure.step", words(procedure::k_step_words)},
      {"topic.procedure.alarm.reaction", words(procedure::k_reaction_words)},
      {"topic.procedure.commands.state", words(k_command_state_words)},
      {"sub.topic", topic_names()},
  };
  // Texts that are chosen where they are written.
  const std::set<std::string> without{"topic.anchors_estimates.status", "topic.devices.state",
                                      "topic.procedure.drone.others.kind"};
  expect_the_same(enums_of_asyncapi(), tables, without);
}

}  // namespace
}  // namespace anchord::api::words_test
