#include "api/calibration/calibration_service.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/admin/job_service.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/calibration/calibration_place.hpp"
#include "api/calibration/check_points_json.hpp"
#include "api/calibration/flight_loading.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/formats/evidence.hpp"
#include "api/wire/budget_json.hpp"
#include "api/wire/exclusion_json.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/track_check.hpp"
#include "core/localize/flight_solver.hpp"
#include "core/localize/fuse.hpp"
#include "core/localize/region_reason.hpp"

namespace anchord::api {

using Json = nlohmann::json;

/// Flights by the place they have in the request; those to learn from stand behind.
struct CalibrationService::Solved {
  Calibration calibration;
  std::vector<FlightData> flights;
  std::vector<std::optional<FlightSolution>> solutions;
  std::vector<KitProfile> learned;
  Json profiles = Json::array();
  Evidence evidence;
  std::size_t n_priors{0};                 ///< anchors with a bearing or a height as a prior
  std::vector<FlightModelsReport> models;  ///< what they did to each flight
  std::optional<CalibrationFrame> frame;   ///< the answers are told in it too
  Json outline;                            ///< of the site, as it was used

  std::vector<std::size_t> of_kit(const std::string& kit) const {
    std::vector<std::size_t> out;
    for (std::size_t i = 0; i < flights.size(); ++i) {
      if (flights[i].mission.kit == kit) out.push_back(i);
    }
    return out;
  }
  std::vector<Mission> missions() const {
    std::vector<Mission> out;
    for (const auto& flight : flights) out.push_back(flight.mission);
    return out;
  }
};

namespace {

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
                          Calibration& out) {
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

/// A flight solved with other than the house's settings says other things about its kit.
bool teaches(const FlightOptions& options) {
  const FlightOptions usual;
  return options.loss == usual.loss && options.weights == usual.weights && options.dims == usual.dims &&
         options.min_fix == usual.min_fix && options.mad_factor == usual.mad_factor && !options.fixed_bias_m;
}

bool believed(const FlightSolution& solution) {
  return std::ranges::any_of(solution.anchors,
                             [](const AnchorSolution& a) { return a.estimate.verdict == Verdict::ok; });
}

Json site_base(const Site& site) {
  const auto text = [](const std::string& t) { return t.empty() ? Json(nullptr) : Json(t); };
  return {{"site", to_string(site.id)},
          {"frame", text(site.crs_frame)},
          {"epoch", site.crs_epoch ? Json(*site.crs_epoch) : Json(nullptr)},
          {"source", text(site.base_source)},
          {"sigma_m", site.base_sigma_m ? Json(*site.base_sigma_m) : Json(nullptr)}};
}

/// Those that applied, by id: which rows they are is in the record, and the digest says that it is that
/// record.
Json exclusions_provenance(const std::vector<Exclusion>& exclusions) {
  Json items = Json::array();
  Sha256 digest;
  for (const auto& e : exclusions) {
    if (!e.applies()) continue;
    digest.add(std::string_view(exclusion_canonical(e)));
    items.push_back({{"id", to_string(e.id)},
                     {"kind", k_row_kind_words.word(e.selection.kind)},
                     {"n_rows", e.n_rows},
                     {"reason", e.reason},
                     {"by", e.by}});
  }
  const bool none = items.empty();
  return {{"items", std::move(items)}, {"sha256", none ? Json(nullptr) : Json(digest.hex())}};
}

Json flight_provenance(const FlightData& flight, const FlightSolution& s) {
  const auto valued = [](const Valued& v) { return Json{{"value", v.value}, {"sigma", v.sigma}}; };
  Json antennas = Json::array();
  for (const auto& one : s.shared.lever_up_by_antenna)
    antennas.push_back(
        {{"tag", to_string(one.tag)}, {"antenna", one.antenna}, {"lever_up_m", valued(one.up_m)}});
  const auto& arm = s.shared.lever_arm_sigma_m;
  return {{"mission", to_string(flight.mission.id)},
          {"name", flight.mission.name},
          {"kit", flight.mission.kit},
          {"bias_m", valued(s.shared.bias_m)},
          {"curve_m_per_efold", valued(s.shared.curve_m)},
          {"lag_s", valued(s.shared.lag_s)},
          {"lever_up_m", valued(s.shared.lever_up_m)},
          {"lever_up_by_antenna", std::move(antennas)},
          {"lever_arm_sigma_m", arm ? Json(*arm) : Json(nullptr)},
          {"bias_determined", s.shared.bias_determined},
          {"n_fixes", s.n_fixes},
          {"n_ranges", s.n_ranges},
          {"n_anchor_anchor", std::ranges::count(flight.rows, RangeKind::anchor_anchor, &FlightRange::kind)},
          {"n_used", s.n_used},
          {"refused", s.refused},
          {"fixes_refused", s.fixes_refused},
          {"exclusions", exclusions_provenance(flight.exclusions)},
          {"notes", s.notes}};
}

/// What was stated about the noise, and how many ranges it bore on: of sigma_m.nlos those a model classified.
Json noise_provenance(const CalibrationRequest& request, const std::vector<FlightModelsReport>& models) {
  std::size_t n_believed = 0;
  for (const auto& report : models) n_believed += report.used ? report.n_believed : 0;
  const auto stated = [](const std::optional<double>& v) { return v ? Json(*v) : Json(nullptr); };
  return {{"los", stated(request.noise.los_m)},
          {"nlos", stated(request.noise.nlos_m)},
          {"rtk", request.options.floor_sigma_m},
          {"n_nlos_applied", request.noise.nlos_m ? n_believed : 0}};
}

/// The budget of an anchor's answer, of several flights through their fusion, with the base's own error.
std::optional<ErrorBudget> budget_of(const std::vector<const AnchorSolution*>& flights, const Estimate& fused,
                                     const std::optional<double>& base_sigma_m) {
  if (!fused.best) return std::nullopt;
  std::vector<BudgetOf> counted;
  const ErrorBudget* chosen = nullptr;
  for (const auto* flight : flights) {
    if (!flight->budget) continue;
    const auto& e = flight->estimate;
    if (e.best->covariance_m2 == fused.best->covariance_m2) chosen = &*flight->budget;
    if (e.verdict == Verdict::ok) counted.push_back({&*flight->budget, e.best->covariance_m2});
  }
  if (chosen == nullptr && counted.empty()) return std::nullopt;
  // As fuse_estimates: where no flight is ok, the narrowest stands for all.
  ErrorBudget budget = chosen != nullptr ? *chosen : fused_budget(counted, fused.best->covariance_m2);
  if (base_sigma_m)
    budget.part(ErrorSource::base) = *base_sigma_m * *base_sigma_m * Eigen::Matrix3d::Identity();
  return budget;
}

/// Misclosures of the surveyed points that the request named.
Json checked(const CalibrationRequest& request, const Calibration& made) {
  const auto settings = Json::parse(request.settings_json, nullptr, false);
  if (!settings.is_object() || !settings.contains("check_points")) return nullptr;
  std::vector<FieldError> errors;  // none: the request was accepted with them
  return check_points_provenance(read_check_points(settings["check_points"], errors), made,
                                 request.options.dims == Dims::two);
}

/// Where an anchor would stand without the models, and how far they moved it.
Json without_models(const Estimate& raw, const Calibration& made) {
  const auto at = std::ranges::find(made.anchors, raw.anchor, &Estimate::anchor);
  Json out{{"network_id", to_string(raw.anchor)}, {"enu_m", nullptr}, {"moved_m", nullptr}};
  if (!raw.best) return out;
  const auto& p = raw.best->position.m;
  out["enu_m"] = {p.x(), p.y(), p.z()};
  if (at != made.anchors.end() && at->best) out["moved_m"] = (at->best->position.m - p).norm();
  return out;
}

/// What the flights say of each anchor.
struct ByAnchor {
  std::map<NetworkId, std::vector<Estimate>> estimates;
  std::map<NetworkId, std::vector<const AnchorSolution*>> solutions;

  void add(const FlightSolution& flight) {
    for (const auto& anchor : flight.anchors) {
      estimates[anchor.estimate.anchor].push_back(anchor.estimate);
      solutions[anchor.estimate.anchor].push_back(&anchor);
    }
  }
};

/// Every anchor of all flights into `out`; the budgets of their errors.
Json fuse_anchors(const ByAnchor& by_anchor, const std::optional<double>& base_sigma_m,
                  const std::optional<CalibrationFrame>& frame, Calibration& out) {
  Json budgets = Json::object();
  for (const auto& [id, estimates] : by_anchor.estimates) {
    Estimate estimate = fuse_estimates(estimates);
    if (const auto budget = budget_of(by_anchor.solutions.at(id), estimate, base_sigma_m)) {
      name_largest_part(estimate, *budget);
      budgets[to_string(id)] = budget_json(*budget, base_sigma_m.has_value());
    }
    if (out.origin) {
      const EnuFrame globe(*out.origin);
      if (estimate.best) estimate.best->wgs84 = globe.wgs84_from_enu(estimate.best->position);
      if (estimate.mirror) estimate.mirror->wgs84 = globe.wgs84_from_enu(estimate.mirror->position);
    }
    if (frame && !out.origin) place_on_globe(*frame, estimate);
    out.anchors.push_back(std::move(estimate));
  }
  return budgets;
}

}  // namespace

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
  const std::string settings = request.settings_json;
  return deps_.jobs.submit(
      "calibration", settings,
      [this, wanted = std::move(request),
       models = std::move(models).value()](JobContext& job) -> Result<JobEnd> {
        BOOST_OUTCOME_TRY(const auto solved, solve(wanted, models, job));
        const Calibration& made = solved.calibration;
        BOOST_OUTCOME_TRYV(deps_.calibrations.insert(made));
        deps_.contradictions.changed();
        (void)deps_.contradictions.standing();
        const std::string id = to_string(made.id);
        for (const auto& profile : solved.learned) {
          BOOST_OUTCOME_TRYV(deps_.profiles.learn(profile, solved.missions(), "calibration " + id));
        }
        return JobEnd{"/api/v1/calibrations/" + id, std::to_string(made.anchors.size()) + " anchors"};
      });
}

/// Flights under the keys by which a profile tells its factors apart, while this lives. They are too large to
/// be copied for that.
class UnderKeys {
 public:
  UnderKeys(std::vector<FlightData>& flights, const std::vector<std::size_t>& members) {
    for (const std::size_t i : members) {
      FlightData& flight = flights[i];
      renamed_.push_back({&flight, flight.mission.name});
      flight.mission.name = KitProfiles::flight_key(flight.mission);
      pointers_.push_back(&flight);
    }
  }
  ~UnderKeys() {
    for (auto& [flight, name] : renamed_) flight->mission.name = std::move(name);
  }
  UnderKeys(const UnderKeys&) = delete;
  UnderKeys& operator=(const UnderKeys&) = delete;

  const std::vector<const FlightData*>& pointers() const { return pointers_; }

 private:
  std::vector<std::pair<FlightData*, std::string>> renamed_;
  std::vector<const FlightData*> pointers_;
};

/// All flights of one kit together, with what the kit's stored profile says about them.
Result<void> CalibrationService::solve_kit(const CalibrationRequest& request, const FlightOptions& options,
                                           Solved& solved, const std::string& kit) {
  FlightOptions of_kit = options;
  std::uint64_t version = 0;
  const bool stored = request.use_profile && !kit.empty();
  if (stored && !of_kit.fixed_bias_m) {
    BOOST_OUTCOME_TRY(auto profile, deps_.profiles.for_flights(kit, solved.missions()));
    if (profile) {
      of_kit.profile = std::move(profile->profile);
      version = profile->version;
    }
  }
  const auto members = solved.of_kit(kit);
  if (request.flight_priors && options.origin) {
    procedure::FlightPriors told;
    for (const std::size_t i : members)
      told = procedure::merged(std::move(told), deps_.flight_priors(solved.flights[i].mission.id));
    // What the request says of an anchor stands; the flights fill in the rest.
    of_kit.priors.merge(procedure::priors_in(told, EnuFrame(*options.origin)));
    solved.n_priors += of_kit.priors.size();
  }
  const UnderKeys keyed(solved.flights, members);
  KitProfile learned;
  BOOST_OUTCOME_TRY(auto answers, solve_flights(keyed.pointers(), of_kit, &learned));
  for (std::size_t k = 0; k < members.size(); ++k) {
    if (!believed(answers[k]))
      std::erase_if(learned.factors,
                    [&](const ProfileFactor& f) { return f.flight == keyed.pointers()[k]->mission.name; });
    solved.solutions[members[k]] = std::move(answers[k]);
  }
  if (!kit.empty()) {
    solved.profiles.push_back({{"kit", kit},
                               {"version", version > 0 ? Json(version) : Json(nullptr)},
                               {"n_flights", of_kit.profile ? of_kit.profile->factors.size() : 0}});
    if (stored && teaches(options)) solved.learned.push_back(std::move(learned));
  }
  if (request.iterations > 0 && !members.empty() && members.front() < request.missions.size() &&
      solved.evidence.course.empty()) {
    BOOST_OUTCOME_TRY(solved.evidence.course,
                      convergence_of(*keyed.pointers().front(), of_kit, request.iterations));
  }
  return boost::outcome_v2::success();
}

Result<void> CalibrationService::solve_kits(const CalibrationRequest& request, const FlightOptions& options,
                                            Solved& solved) {
  solved.solutions.resize(solved.flights.size());
  std::set<std::string> kits;
  for (const auto& flight : solved.flights) kits.insert(flight.mission.kit);
  for (const auto& kit : kits) {
    BOOST_OUTCOME_TRYV(solve_kit(request, options, solved, kit));
  }
  return boost::outcome_v2::success();
}

Result<void> CalibrationService::load(const CalibrationRequest& request, const ModelRegistry::Active& models,
                                      JobContext& job, Solved& solved) {
  std::vector<MissionId> all = request.missions;
  all.insert(all.end(), request.learn_from.begin(), request.learn_from.end());
  for (const auto& id : all) {
    BOOST_OUTCOME_TRY(auto mission, deps_.missions.mission(id));
    BOOST_OUTCOME_TRY(const auto exclusions, deps_.exclusions.exclusions(id));
    FlightLoading how{.canceled = [&] { return job.canceled(); },
                      .exclusions = exclusions,
                      .between_anchors = request.use_anchor_anchor,
                      .with_cir = models.needs_cir};
    if (!models.predictor.empty()) {
      how.correct = [&, &report = solved.models.emplace_back()](FlightData& part) {
        report += correct_flight(models, part, request.likelihood, request.noise);
      };
    }
    BOOST_OUTCOME_TRY(auto flight, load_flight(deps_.measurements, mission, how));
    solved.flights.push_back(std::move(flight));
    job.progress(0.3 * static_cast<double>(solved.flights.size()) / static_cast<double>(all.size()), "load",
                 solved.flights.back().mission.name);
  }
  return boost::outcome_v2::success();
}

FlightOptions CalibrationService::options_of(const CalibrationRequest& request, JobContext& job) const {
  FlightOptions options = request.options;
  options.track = deps_.track;
  const auto take = [](const std::optional<double>& told, double& limit) { limit = told.value_or(limit); };
  take(request.max_correction_age_s, options.track.max_correction_age_s);
  take(request.max_speed_mps, options.track.max_speed_mps);
  take(request.max_acceleration_mps2, options.track.max_acceleration_mps2);
  options.canceled = [&job] { return job.canceled(); };
  return options;
}

Result<void> CalibrationService::solve_by_models(const CalibrationRequest& request,
                                                 const FlightOptions& options, JobContext& job,
                                                 Solved& solved, Solved& raw) {
  CalibrationRequest wanted = request;
  std::size_t n_corrected = 0, n_believed = 0;
  for (const auto& report : solved.models) {
    n_corrected += report.n_corrected;
    n_believed += report.n_believed;
  }
  // A kit's profile tells the bias of raw ranges: of corrected ones it would take it off twice, and what
  // these teach is no bias of the kit.
  if (n_corrected > 0) wanted.use_profile = false;
  if (n_corrected + n_believed > 0 && (request.compare_uncorrected || request.models.ask_worth)) {
    for (const auto& flight : solved.flights) raw.flights.push_back(as_received(flight));
  }
  BOOST_OUTCOME_TRYV(solve_kits(wanted, options, solved));
  if (raw.flights.empty()) return boost::outcome_v2::success();
  job.progress(0.7, "solve", "without the models");
  CalibrationRequest plain = request;
  plain.iterations = 0;
  BOOST_OUTCOME_TRYV(solve_kits(plain, options, raw));
  if (request.models.ask_worth &&
      leave_out_worthless(solved.models, solved.flights, raw.flights, solved.solutions, raw.solutions)) {
    job.progress(0.8, "solve", "without models that show no worth");
    const bool corrected =
        std::ranges::any_of(solved.models, [](const auto& m) { return m.used && m.n_corrected > 0; });
    if (!corrected) wanted.use_profile = request.use_profile;
    solved.profiles = Json::array();
    solved.n_priors = 0;
    solved.evidence.course.clear();
    BOOST_OUTCOME_TRYV(solve_kits(wanted, options, solved));
  }
  solved.learned = std::move(raw.learned);
  return boost::outcome_v2::success();
}

void CalibrationService::conclude(const CalibrationRequest& request, const ModelRegistry::Active& models,
                                  Solved& solved, const Solved& raw) const {
  Calibration& out = solved.calibration;
  const bool compared = !raw.flights.empty() && request.compare_uncorrected;
  ByAnchor by_anchor, by_anchor_raw;
  Json flights = Json::array();
  for (std::size_t i = 0; i < request.missions.size(); ++i) {
    const auto& solution = *solved.solutions[i];
    by_anchor.add(solution);
    solved.evidence.flights.push_back(evidence_of(solved.flights[i], solution, out.origin));
    flights.push_back(flight_provenance(solved.flights[i], solution));
    if (compared) by_anchor_raw.add(*raw.solutions[i]);
  }
  Json base = nullptr;
  std::optional<double> base_sigma_m;
  if (const auto& site = solved.flights.front().mission.site) {
    if (const auto found = deps_.sites.site(*site)) {
      base = site_base(found.value());
      // Local metres say nothing of a base.
      if (out.frame == TrackFrame::wgs84) base_sigma_m = found.value().base_sigma_m;
    }
  }
  Json budgets = fuse_anchors(by_anchor, base_sigma_m, solved.frame, out);
  Json uncorrected = compared ? Json::array() : Json(nullptr);
  for (const auto& [id, estimates] : by_anchor_raw.estimates)
    uncorrected.push_back(without_models(fuse_estimates(estimates), out));
  out.provenance = {to_wire(Json{
      {"profiles", std::move(solved.profiles)},
      {"base", std::move(base)},
      {"budgets", std::move(budgets)},
      {"check_points", checked(request, out)},
      {"n_priors", solved.n_priors},
      {"n_clues", solved.n_priors},  // up to 0.1; with the one below, for clients of that contract
      {"frame", solved.frame ? frame_provenance(*solved.frame, out) : Json(nullptr)},
      {"priors", {{"outline", solved.outline}}},
      {"clues", {{"outline", solved.outline}}},
      {"sigma_m", noise_provenance(request, solved.models)},
      {"models", models.predictor.empty() ? Json(nullptr) : Json(flight_models_json(models, solved.models))},
      {"uncorrected", std::move(uncorrected)},
      {"flights", std::move(flights)}})};
  out.evidence = {evidence_json(solved.evidence)};
}

Result<CalibrationService::Solved> CalibrationService::solve(const CalibrationRequest& request,
                                                             const ModelRegistry::Active& models,
                                                             JobContext& job) {
  Solved solved;
  BOOST_OUTCOME_TRYV(load(request, models, job, solved));
  FlightOptions options = options_of(request, job);
  Calibration& out = solved.calibration;
  BOOST_OUTCOME_TRYV(choose_frame(solved.flights, deps_.sites, options, out));
  if (!request.frame.empty()) {
    BOOST_OUTCOME_TRY(solved.frame, calibration_frame(deps_.frames, request.frame));
  }
  solved.outline =
      use_site_outline(request.site_outline, solved.flights, out.origin, solved.frame, deps_.sites, options);
  job.progress(0.3, "solve", std::to_string(solved.flights.size()) + " flights");
  Solved raw;
  BOOST_OUTCOME_TRYV(solve_by_models(request, options, job, solved, raw));
  if (job.canceled()) return make_error(Errc::canceled, "canceled");
  conclude(request, models, solved, raw);
  out.created = deps_.clock.now();
  out.id.uuid = job.job().id.uuid;  // the job and what it makes share their number
  out.missions = request.missions;
  out.settings = {request.settings_json};
  job.progress(0.95, "store", "");
  return solved;
}

}  // namespace anchord::api
