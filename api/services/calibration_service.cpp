#include "api/services/calibration_service.hpp"

#include <nlohmann/json.hpp>
#include <set>

#include "api/json/reader.hpp"
#include "api/json/wire_resources.hpp"
#include "api/services/job_service.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/fuse.hpp"

namespace anchord::api {

using Json = nlohmann::json;

CalibrationRequest read_calibration_request(const Json& body, std::vector<FieldError>& errors) {
  CalibrationRequest out;
  Fields fields(body, "", errors);
  std::set<std::string> seen;
  const auto read_ids = [&](const char* key, std::vector<MissionId>& ids) {
    const Json* list = fields.child(key);
    if (list == nullptr) return;
    if (!list->is_array() || list->empty() || list->size() > 100)
      return fields.error(key, "wrong_type", "must be an array of 1 to 100 mission ids");
    for (std::size_t i = 0; i < list->size(); ++i) {
      const auto& item = (*list)[i];
      const auto id = parse_uuid(item.is_string() ? item.get_ref<const std::string&>() : "");
      const std::string at = std::string("/") + key + '/' + std::to_string(i);
      if (!id)
        errors.push_back({at, "bad_id", id.error().message});
      else if (!seen.insert(to_string(id.value())).second)
        errors.push_back({at, "duplicate", "the mission stands twice"});
      else
        ids.push_back(MissionId{id.value()});
    }
  };
  if (!fields.has("missions")) fields.error("missions", "required", "missions is missing");
  read_ids("missions", out.missions);
  read_ids("learn_from", out.learn_from);
  auto& options = out.options;
  if (const auto dims = fields.integer("dims", 2, 3)) options.dims = *dims == 2 ? Dims::two : Dims::three;
  if (const auto solver = fields.word("solver", {"gauss_newton", "levenberg_marquardt", "dogleg"}))
    options.method = static_cast<anchord::Method>(*solver);
  if (const auto weights = fields.word("weights", {"inverse_variance", "dissertation"}))
    options.weights = static_cast<Weights>(*weights);
  if (const Json* loss = fields.child("loss")) {
    Fields inner(*loss, "/loss", errors);
    if (const auto type = inner.word("type", {"none", "huber", "cauchy", "tukey"}, true))
      options.loss = static_cast<Loss>(*type);
    // The robust scale comes from the residuals themselves; `scale` stretches it, 1.5 being the neutral value
    // of api.md.
    if (const auto scale = inner.number("scale", 0.1, 10)) options.mad_factor *= *scale / 1.5;
    inner.finish();
  }
  if (const auto height = fields.number("anchor_height_m", -1000, 9000)) options.anchor_height_m = *height;
  if (const auto gap = fields.number("max_gap_s", 0.01, 10)) options.max_gap_s = *gap;
  if (const auto fix = fields.word("min_fix", {"none", "single", "dgps", "float", "fixed"}))
    options.min_fix = static_cast<FixClass>(*fix);
  for (const char* later :
       {"frame", "use_anchor_anchor", "models", "sigma_m", "initial", "compare_uncorrected"}) {
    if (fields.child(later) != nullptr)
      fields.error(later, "unsupported", std::string(later) + " cannot be set in this version");
  }
  fields.finish();
  out.settings_json = body.is_object() ? [&] {
    Json settings = body;
    settings.erase("missions");
    return settings.dump();
  }() : "{}";
  return out;
}

Result<FlightData> load_flight(MeasurementStore& store, const Mission& mission,
                               const std::function<bool()>& canceled) {
  FlightData flight;
  flight.mission = mission;
  MeasurementStore::Filter filter;
  filter.mission = mission.id;
  filter.limit = 10'000;
  do {
    if (canceled()) return make_error(Errc::canceled, "canceled");
    BOOST_OUTCOME_TRY(auto page, store.fixes(filter));
    for (auto& row : page.rows) flight.fixes.push_back(std::move(row));
    filter.after = page.next;
  } while (!filter.after.empty());
  do {
    if (canceled()) return make_error(Errc::canceled, "canceled");
    BOOST_OUTCOME_TRY(auto page, store.ranges(filter));
    for (auto& row : page.rows) flight.ranges.push_back(std::move(row));
    filter.after = page.next;
  } while (!filter.after.empty());
  return flight;
}

Result<Job> CalibrationService::submit(CalibrationRequest request) {
  for (const auto& id : request.missions) {
    BOOST_OUTCOME_TRYV(deps_.missions.mission(id));
  }
  const std::string settings = request.settings_json;
  return deps_.jobs.submit("calibration", settings,
                           [this, wanted = std::move(request)](JobContext& job) -> Result<JobEnd> {
                             BOOST_OUTCOME_TRY(const auto made, solve(wanted, job));
                             BOOST_OUTCOME_TRYV(deps_.anchors.insert(made));
                             return JobEnd{"/api/v1/calibrations/" + to_string(made.id),
                                           std::to_string(made.anchors.size()) + " anchors"};
                           });
}

Result<Calibration> CalibrationService::solve(const CalibrationRequest& request, JobContext& job) {
  const auto canceled_now = [&] { return job.canceled(); };
  std::vector<FlightData> flights;
  std::vector<MissionId> all = request.missions;
  all.insert(all.end(), request.learn_from.begin(), request.learn_from.end());
  for (const auto& id : all) {
    BOOST_OUTCOME_TRY(auto mission, deps_.missions.mission(id));
    BOOST_OUTCOME_TRY(auto flight, load_flight(deps_.measurements, mission, canceled_now));
    flights.push_back(std::move(flight));
    job.progress(0.3 * static_cast<double>(flights.size()) / static_cast<double>(all.size()), "load",
                 flights.back().mission.name);
  }
  FlightOptions options = request.options;
  options.canceled = canceled_now;
  Calibration out;
  out.frame = flights.front().mission.frame;
  for (const auto& flight : flights) {
    if (flight.mission.frame != out.frame)
      return make_error(Errc::invalid_argument,
                        "missions on the globe and in a local frame cannot be solved together");
    if (out.frame != TrackFrame::wgs84 || options.origin) continue;
    for (const auto& fix :
         flight.fixes) {  // one frame for all flights, so that their answers can be compared
      if (fix.fix >= options.min_fix && fix.frame == TrackFrame::wgs84) {
        options.origin = fix.position;
        break;
      }
    }
  }
  job.progress(0.3, "solve", std::to_string(flights.size()) + " flights");
  std::vector<const FlightData*> pointers;
  for (const auto& flight : flights) pointers.push_back(&flight);
  BOOST_OUTCOME_TRY(auto solutions, solve_flights(pointers, options));
  if (canceled_now()) return make_error(Errc::canceled, "canceled");
  out.origin = out.frame == TrackFrame::wgs84 ? options.origin : std::nullopt;

  std::map<NetworkId, std::vector<Estimate>> by_anchor;
  for (std::size_t i = 0; i < request.missions.size(); ++i) {
    const auto& solution = solutions[i];
    for (const auto& anchor : solution.anchors) by_anchor[anchor.estimate.anchor].push_back(anchor.estimate);
  }
  for (const auto& [id, estimates] : by_anchor) {
    Estimate estimate = fuse_estimates(estimates);
    if (out.origin) {
      const EnuFrame frame(*out.origin);
      if (estimate.best) estimate.best->wgs84 = frame.wgs84_from_enu(estimate.best->position);
      if (estimate.mirror) estimate.mirror->wgs84 = frame.wgs84_from_enu(estimate.mirror->position);
    }
    out.anchors.push_back(std::move(estimate));
  }
  out.created = deps_.clock.now();
  out.id.uuid = job.job().id.uuid;  // the job and what it makes share their number
  out.missions = request.missions;
  out.settings_json = request.settings_json;
  job.progress(0.95, "store", "");
  return out;
}

}  // namespace anchord::api
