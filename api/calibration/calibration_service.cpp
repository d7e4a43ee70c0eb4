#include "api/calibration/calibration_service.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/admin/job_service.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/site_json.hpp"
#include "api/calibration/calibration_place.hpp"
#include "api/calibration/calibration_work.hpp"
#include "api/calibration/flight_loading.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/calibration/outdated_gate.hpp"
#include "api/work/work_desk.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/track_check.hpp"

namespace anchord::api {

using Json = nlohmann::json;

/// What is to be solved, and what the server keeps to itself of it.
struct CalibrationService::Prepared {
  CalibrationTask task;
  CalibrationOrder order;
};

/// Asked and told while flights are read.
struct CalibrationService::Reading {
  std::function<bool()> canceled = [] { return false; };
  std::function<void(double fraction, const std::string& flight)> progress = [](double, const std::string&) {
  };
};

namespace {

constexpr const char* k_kind = "calibration";
/// Of a calibration, when its flights are read, and when they are solved.
constexpr double k_read = 0.3, k_solved = 0.95;

/// The one site's origin where the flights are near it; nothing else is as steady from calibration to
/// calibration.
std::optional<Wgs84> site_origin(const std::vector<FlightData>& flights, SiteStore& sites,
                                 const Wgs84& middle, double max_distance_m) {
  const auto& site = flights.front().mission.site;
  if (!site) return std::nullopt;
  for (const auto& flight : flights)
    if (flight.mission.site != site) return std::nullopt;
  const auto found = sites.site(*site);
  if (!found || !found.value().origin) return std::nullopt;
  const bool near =
      (ecef_from_wgs84(*found.value().origin) - ecef_from_wgs84(middle)).norm() <= max_distance_m;
  return near ? found.value().origin : std::nullopt;
}

/// One frame for all flights, so that their answers can be compared: the site's, else the middle of the first
/// flight's positions as far as they are believed.
Result<void> choose_frame(const std::vector<FlightData>& flights, SiteStore& sites, FlightOptions& options,
                          CalibrationOrder& out) {
  out.frame = flights.front().mission.frame;
  for (const auto& flight : flights) {
    if (flight.mission.frame != out.frame)
      return make_error(Errc::invalid_argument,
                        "missions on the globe and in a local frame cannot be solved together");
    // Local coordinates of two places share no origin: their numbers would mix without anybody noticing.
    const Mission& first = flights.front().mission;
    if (out.frame == TrackFrame::local && flight.mission.site && first.site &&
        *flight.mission.site != *first.site)
      return make_error(Errc::invalid_argument,
                        first.name + " and " + flight.mission.name +
                            " are in local frames of different sites and cannot be solved together");
    if (out.frame != TrackFrame::wgs84 || options.origin) continue;
    const auto checked = check_track(flight.fixes, out.frame, options.min_fix, options.track);
    if (!checked.centre) continue;
    const auto of_site = site_origin(flights, sites, *checked.centre, options.track.max_distance_m);
    options.origin = of_site ? of_site : checked.centre;
  }
  out.origin = out.frame == TrackFrame::wgs84 ? options.origin : std::nullopt;
  return boost::outcome_v2::success();
}

/// Anchors that the ranges of a flight name, those included that a person left out.
std::vector<NetworkId> anchors_of(const FlightData& flight) {
  std::set<NetworkId> ids;
  for (const FlightRange& row : flight.rows) {
    ids.insert(row.anchor);
    if (row.kind == RangeKind::anchor_anchor) ids.insert(row.tag);
  }
  for (const auto& [id, n] : flight.n_ranges_excluded) ids.insert(id);
  return {ids.begin(), ids.end()};
}

CalibrationOrder::Flight ordered(const FlightData& flight) {
  const auto between = std::ranges::count(flight.rows, RangeKind::anchor_anchor, &FlightRange::kind);
  return {flight.mission.id,
          flight.mission.name,
          flight.mission.kit,
          exclusions_json(flight.exclusions),
          declared_sha256(flight.mission),
          flight.fixes.size(),
          flight.rows.size(),
          static_cast<std::size_t>(between),
          anchors_of(flight)};
}

/// A request as kept with a job that is done elsewhere.
Document kept_request(const CalibrationRequest& request, const CalibrationOrder& order) {
  Json models = Json::object();
  for (const auto& [task, id] : order.models) models[task] = to_string(id);
  return {to_wire(Json{{"request", Json::parse(request.body_json, nullptr, false)},
                       {"settings", request.settings_json},
                       {"models", std::move(models)},
                       {"correction", ml::k_correction_words.word(order.correction)},
                       {"order", order_text(order)}})};
}

Error unreadable(const JobId& id, const std::string& why) {
  return make_error(Errc::internal, "job " + to_string(id) + ": its request cannot be read: " + why);
}

}  // namespace

CalibrationService::CalibrationService(Deps deps) : deps_(std::move(deps)) {
  if (deps_.desk == nullptr) return;
  deps_.desk->add(k_kind,
                  {.message = [this](const JobId& id) { return message_anew(id); },
                   .take_in = [this](const Job& job, const std::string& text) { return take_in(job, text); },
                   .done_before = k_read,
                   .of_one_version = true});
}

Result<Job> CalibrationService::submit(CalibrationRequest request) {
  for (const auto& id : request.missions) {
    BOOST_OUTCOME_TRYV(deps_.missions.mission(id));
  }
  // Chosen now: a promotion while the job waits changes nothing of what was asked for.
  auto models = models_for(request.models, deps_.models);
  if (!models) return make_error(Errc::invalid_argument, "models: " + models.error().message);
  if (!request.frame.empty()) {  // asked now: a frame nobody fitted is no reason to solve for minutes
    const auto frame = calibration_frame(deps_.frames, request.frame);
    if (!frame) return make_error(Errc::invalid_argument, "frame: " + frame.error().message);
  }
  if (deps_.desk != nullptr) {
    BOOST_OUTCOME_TRYV(deps_.desk->room_for(k_kind));
  }
  const std::string settings = request.settings_json;
  return deps_.jobs.submit(
      k_kind, settings,
      [this, wanted = std::move(request),
       models = std::move(models).value()](JobContext& job) -> Result<JobEnd> {
        const Reading reading{[&job] { return job.canceled(); },
                              [&job](double fraction, const std::string& flight) {
                                job.progress(k_read * fraction, "load", flight);
                              }};
        BOOST_OUTCOME_TRY(auto prepared, prepare(wanted, models, reading));
        BOOST_OUTCOME_TRY(const bool elsewhere, handed_over(wanted, prepared, job));
        if (elsewhere) return JobEnd{.elsewhere = true};
        prepared.task.options.canceled = reading.canceled;
        BOOST_OUTCOME_TRY(
            auto answer, solve_calibration(prepared.task, [&job](double fraction, const std::string& detail) {
              job.progress(k_read + (k_solved - k_read) * fraction, "solve", detail);
            }));
        job.progress(k_solved, "store", "");
        return keep(job.job().id, prepared.order, std::move(answer));
      });
}

/// Whoever claims it solves it; false: this server is to do it itself.
Result<bool> CalibrationService::handed_over(const CalibrationRequest& request, const Prepared& prepared,
                                             JobContext& job) {
  if (deps_.desk == nullptr || answer_bytes(prepared.order) > k_most_answer_bytes) return false;
  auto message = calibration_message(prepared.task);
  if (message.size() > k_most_message_bytes) return false;
  if (job.canceled()) return make_error(Errc::canceled, "canceled");
  Job handed = job.job();
  handed.request = kept_request(request, prepared.order);
  handed.detail = {};
  BOOST_OUTCOME_TRYV(deps_.desk->hand_over(std::move(handed), std::move(message)));
  return true;
}

/// Of a job that a server of another version handed out: its flights are read again.
Result<std::string> CalibrationService::message_anew(const JobId& id) {
  BOOST_OUTCOME_TRY(auto job, deps_.job_store.job(id));
  const auto kept = Json::parse(job.request.text, nullptr, false);
  try {
    std::vector<FieldError> errors;
    auto request = read_calibration_request(kept.at("request"), errors);
    if (!errors.empty()) return unreadable(id, errors.front().pointer + ": " + errors.front().detail);
    request.settings_json = kept.at("settings").get<std::string>();
    std::map<std::string, ModelId> chosen;
    for (const auto& [task, text] : kept.at("models").items()) {
      BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(text.get<std::string>()));
      chosen[task] = ModelId{uuid};
    }
    BOOST_OUTCOME_TRY(const auto correction,
                      ml::k_correction_words.parse("correction", kept.at("correction").get<std::string>()));
    BOOST_OUTCOME_TRY(const auto models, load_models(deps_.models.source(), chosen, correction, true));
    BOOST_OUTCOME_TRY(const auto prepared, prepare(request, models, {}));
    job.request = kept_request(request, prepared.order);
    BOOST_OUTCOME_TRYV(deps_.jobs.save(job));
    return calibration_message(prepared.task);
  } catch (const Json::exception& fault) {
    return unreadable(id, fault.what());
  }
}

Result<JobEnd> CalibrationService::take_in(const Job& job, const std::string& text) {
  const auto kept = Json::parse(job.request.text, nullptr, false);
  if (!kept.is_object() || !kept.contains("order") || !kept["order"].is_string())
    return unreadable(job.id, "it has no order");
  BOOST_OUTCOME_TRY(const auto order, read_order(kept["order"].get_ref<const std::string&>()));
  auto answer = read_answer(order, text);
  if (!answer)
    return make_error(Errc::link_lost, "the result of worker " + job.worker + " is refused: " +
                                           answer.error().message + "; nothing of it is stored");
  return keep(job.id, order, std::move(answer).value());
}

/// Stored once, however often it is tried: whoever was killed on the way begins here again.
Result<JobEnd> CalibrationService::keep(const JobId& job, const CalibrationOrder& order,
                                        CalibrationAnswer answer) {
  const auto learned = std::move(answer.learned);
  BOOST_OUTCOME_TRY(auto made, record_of(order, std::move(answer)));
  made.created = deps_.clock.now();
  made.id.uuid = job.uuid;  // the job and what it makes share their number
  const std::string id = to_string(made.id);
  const auto before = deps_.calibrations.calibration(made.id);
  if (!before && before.error().code != Errc::not_found) return before.error();
  if (!before) {
    BOOST_OUTCOME_TRYV(deps_.calibrations.insert(made));
  }
  deps_.contradictions.changed();
  (void)deps_.contradictions.standing();
  for (const auto& profile : learned) {
    BOOST_OUTCOME_TRYV(deps_.profiles.learn(profile, missions_of(order), "calibration " + id));
  }
  return JobEnd{"/api/v1/calibrations/" + id, std::to_string(made.anchors.size()) + " anchors"};
}

Result<void> CalibrationService::load(const CalibrationRequest& request, const ModelRegistry::Active& models,
                                      const Reading& reading, Prepared& out) {
  std::vector<MissionId> all = request.missions;
  all.insert(all.end(), request.learn_from.begin(), request.learn_from.end());
  for (const auto& id : all) {
    BOOST_OUTCOME_TRY(auto mission, deps_.missions.mission(id));
    BOOST_OUTCOME_TRY(const auto exclusions, deps_.exclusions.exclusions(id));
    FlightLoading how{.canceled = reading.canceled,
                      .exclusions = exclusions,
                      .between_anchors = request.use_anchor_anchor,
                      .with_cir = models.needs_cir};
    if (!models.predictor.empty()) {
      how.correct = [&, &report = out.task.models.emplace_back()](FlightData& part) {
        report += correct_flight(models, part, request.likelihood, request.noise);
      };
    }
    BOOST_OUTCOME_TRY(auto flight, load_flight(deps_.measurements, mission, how));
    out.order.flights.push_back(ordered(flight));
    out.task.flights.push_back(std::move(flight));
    reading.progress(static_cast<double>(out.task.flights.size()) / static_cast<double>(all.size()),
                     out.task.flights.back().mission.name);
  }
  return boost::outcome_v2::success();
}

FlightOptions CalibrationService::options_of(const CalibrationRequest& request) const {
  FlightOptions options = request.options;
  options.track = deps_.track;
  const auto take = [](const std::optional<double>& told, double& limit) { limit = told.value_or(limit); };
  take(request.max_correction_age_s, options.track.max_correction_age_s);
  take(request.max_speed_mps, options.track.max_speed_mps);
  take(request.max_acceleration_mps2, options.track.max_acceleration_mps2);
  return options;
}

/// What the stored profiles and the flights themselves tell of each kit and its anchors.
Result<void> CalibrationService::ask_kits(const CalibrationRequest& request, Prepared& out) {
  auto& [task, order] = out;
  const auto missions = missions_of(order);
  std::map<std::string, CalibrationTask::Kit> kits;
  for (const auto& flight : task.flights) kits[flight.mission.kit].name = flight.mission.kit;
  for (auto& [name, kit] : kits) {
    CalibrationOrder::Kit known{name};
    if (request.use_profile && !name.empty() && !task.options.fixed_bias_m) {
      BOOST_OUTCOME_TRY(auto profile, deps_.profiles.for_flights(name, missions));
      if (profile) {
        known.version = profile->version;
        known.n_flights = profile->profile.factors.size();
        kit.profile = std::move(profile->profile);
      }
    }
    kit.priors = task.options.priors;
    if (request.flight_priors && task.options.origin) {
      procedure::FlightPriors told;
      for (const auto& flight : task.flights) {
        if (flight.mission.kit == name)
          told = procedure::merged(std::move(told), deps_.flight_priors(flight.mission.id));
      }
      // What the request says of an anchor stands; the flights fill in the rest.
      kit.priors.merge(procedure::priors_in(told, EnuFrame(*task.options.origin)));
      order.n_priors += kit.priors.size();
    }
    if (!name.empty()) order.kits.push_back(std::move(known));
    task.kits.push_back(std::move(kit));
  }
  return boost::outcome_v2::success();
}

Result<CalibrationService::Prepared> CalibrationService::prepare(const CalibrationRequest& request,
                                                                 const ModelRegistry::Active& models,
                                                                 const Reading& reading) {
  Prepared out;
  auto& [task, order] = out;
  BOOST_OUTCOME_TRYV(load(request, models, reading, out));
  task.options = options_of(request);
  order.n_answered = task.n_answered = request.missions.size();
  BOOST_OUTCOME_TRYV(choose_frame(task.flights, deps_.sites, task.options, order));
  std::optional<CalibrationFrame> frame;
  if (!request.frame.empty()) {
    BOOST_OUTCOME_TRY(frame, calibration_frame(deps_.frames, request.frame));
    order.local_frame = frame->frame;
  }
  order.outline_json = to_wire(
      use_site_outline(request.site_outline, task.flights, order.origin, frame, deps_.sites, task.options));
  BOOST_OUTCOME_TRYV(ask_kits(request, out));
  if (const auto& site = task.flights.front().mission.site) {
    if (const auto found = deps_.sites.site(*site)) {
      order.base_json = to_wire(site_base_json(found.value()));
      // Local metres say nothing of a base.
      if (order.frame == TrackFrame::wgs84) order.base_sigma_m = found.value().base_sigma_m;
    }
  }
  order.use_profile = task.use_profile = request.use_profile;
  order.iterations = task.iterations = request.iterations;
  order.compare_uncorrected = task.compare_uncorrected = request.compare_uncorrected;
  order.ask_worth = task.ask_worth = request.models.ask_worth;
  order.teaches = teaches(task.options);
  order.plane = request.options.dims == Dims::two;
  order.settings_json = request.settings_json;
  order.noise = request.noise;
  order.floor_sigma_m = request.options.floor_sigma_m;
  order.models = models.models;
  order.correction = models.correction;
  order.reports = task.models;
  return out;
}

}  // namespace anchord::api
