#include "server/cli/site_flight.hpp"

#include <nlohmann/json.hpp>
#include <utility>

#include "drivers/sim/flight.hpp"
#include "drivers/sim/scenario.hpp"
#include "server/cli/flight_upload.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_json.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;

constexpr const char* k_mission = "Demonstration building, finished flight";

Result<FlightData> flown() {
  sim::SimulationOptions options;
  options.seed = 11;  // not that of `simulate demonstration`, whose live flight comes after it
  options.radio = sim::scenario_radio();
  options.impulse = sim::ImpulseOptions{};
  BOOST_OUTCOME_TRY(auto flight, sim::simulate_flight(sim::demonstration_world(), options));
  for (Range& range : flight.data.ranges) range.truth.reset();  // nobody knows it in a flight
  prepare_rows(flight.data);
  return std::move(flight.data);
}

/// The newest of that name; null when there is none.
Result<Json> mission_there(RestClient& client) {
  BOOST_OUTCOME_TRY(const auto missions, get_items(client, "/api/v1/missions"));
  for (const auto& mission : missions) {
    if (text_of(mission, "name") == k_mission) return mission;
  }
  return Json{};
}

/// Id of the finished mission. The flight ends when its mission was made, so that one whose upload was
/// interrupted gets the same rows again, which are known, and the rest.
Result<std::string> finished_mission(RestClient& client, const Told& told) {
  BOOST_OUTCOME_TRY(auto mission, mission_there(client));
  if (text_of(mission, "state") == "finished") {
    told("flight \"" + std::string(k_mission) + "\": already exists");
    return text_of(mission, "id");
  }
  BOOST_OUTCOME_TRY(auto flight, flown());
  FlightUpload upload(client, std::move(flight));
  if (mission.is_object()) {
    BOOST_OUTCOME_TRYV(upload.use_mission(text_of(mission, "id")));
  } else {
    BOOST_OUTCOME_TRYV(upload.create_mission(k_mission));
    BOOST_OUTCOME_TRY(mission, get_json(client, "/api/v1/missions/" + upload.mission_id()));
  }
  BOOST_OUTCOME_TRY(const auto created, parse_rfc3339(text_of(mission, "created_at")));
  upload.shift(created.ns - upload.last().ns);
  while (!upload.done()) {
    BOOST_OUTCOME_TRYV(upload.send_next_batch());
  }
  BOOST_OUTCOME_TRYV(upload.finish_mission());
  told("flight \"" + std::string(k_mission) + "\" imported: " + upload.summary());
  return upload.mission_id();
}

/// Path of the newest calibration of this mission alone; solves it where there is none.
Result<std::string> calibration_of(RestClient& client, const std::string& mission, const Told& told) {
  BOOST_OUTCOME_TRY(const auto calibrations, get_items(client, "/api/v1/calibrations"));
  for (const auto& one : calibrations) {
    if (one.value("missions", Json()) == Json::array({mission}))
      return "/api/v1/calibrations/" + text_of(one, "id");
  }
  told("calibrating ...");
  BOOST_OUTCOME_TRY(const auto job, post_json(client, "/api/v1/calibrations", {{"missions", {mission}}}));
  return result_of_job(client, job);
}

}  // namespace

Result<void> add_demonstration_flight(RestClient& client, bool over_others, const Told& told) {
  BOOST_OUTCOME_TRY(const auto mission, finished_mission(client, told));
  BOOST_OUTCOME_TRY(const auto calibration, calibration_of(client, mission, told));
  const auto id = calibration.substr(calibration.rfind('/') + 1);
  BOOST_OUTCOME_TRY(const auto revisions, get_items(client, "/api/v1/revisions"));
  for (const auto& revision : revisions) {
    if (text_of(revision, "calibration") != id) continue;
    told("revision " + std::to_string(revision.value("revision", 0)) + " of it: already exists");
    return boost::outcome_v2::success();
  }
  if (!revisions.empty() && !over_others) {
    told("not published: revision " + std::to_string(revisions.front().value("revision", 0)) +
         " exists; with --over-others the simulated anchors are published in addition");
    return boost::outcome_v2::success();
  }
  BOOST_OUTCOME_TRY(
      const auto published,
      post_json(client, calibration + "/publish",
                {{"note", "Demonstration building, simulated: anchors that passed the gates"}}));
  told("revision " + std::to_string(published.value("revision", 0)) +
       " published: " + std::to_string(published.value("anchors", Json::array()).size()) + " anchors, " +
       std::to_string(published.value("left_out", Json::array()).size()) + " left out by the gates");
  return boost::outcome_v2::success();
}

}  // namespace anchord::cli
