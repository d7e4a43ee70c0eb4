#include "api/calibration/calibration_record.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "api/calibration/calibration_place.hpp"
#include "api/calibration/check_points_json.hpp"
#include "api/calibration/kit_profiles.hpp"
#include "api/wire/budget_json.hpp"
#include "api/wire/exclusion_json.hpp"
#include "core/base/sha256.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/fuse.hpp"
#include "core/localize/region_reason.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

Json flight_provenance(const CalibrationOrder& order, std::size_t index, const FlightAnswer& answer) {
  const CalibrationOrder::Flight& flight = order.flights[index];
  const FlightEvidence& s = answer.evidence;
  const auto valued = [](const Valued& v) { return Json{{"value", v.value}, {"sigma", v.sigma}}; };
  Json antennas = Json::array();
  for (const auto& one : s.shared.lever_up_by_antenna)
    antennas.push_back(
        {{"tag", to_string(one.tag)}, {"antenna", one.antenna}, {"lever_up_m", valued(one.up_m)}});
  const auto& arm = s.shared.lever_arm_sigma_m;
  return {{"mission", to_string(flight.id)},
          {"name", flight.name},
          {"kit", flight.kit},
          {"bias_m", valued(s.shared.bias_m)},
          {"curve_m_per_efold", valued(s.shared.curve_m)},
          {"lag_s", valued(s.shared.lag_s)},
          {"lever_up_m", valued(s.shared.lever_up_m)},
          {"lever_up_by_antenna", std::move(antennas)},
          {"lever_arm_sigma_m", arm ? Json(*arm) : Json(nullptr)},
          {"bias_determined", s.shared.bias_determined},
          {"n_fixes", s.n_fixes},
          {"n_ranges", s.n_ranges},
          {"n_anchor_anchor", flight.n_anchor_anchor},
          {"n_used", s.n_used},
          {"copy_of", answer.copy_of ? Json(to_string(order.flights[*answer.copy_of].id)) : Json(nullptr)},
          {"refused", s.refused},
          {"fixes_refused", answer.fixes_refused},
          {"declared_sha256", flight.declared_sha256},
          {"exclusions", Json::parse(flight.exclusions_json, nullptr, false)},
          {"notes", s.notes}};
}

/// What was stated about the noise, and how many ranges it bore on: of sigma_m.nlos those a model classified.
Json noise_provenance(const CalibrationOrder& order, const std::vector<FlightModelsReport>& models) {
  std::size_t n_believed = 0;
  for (const auto& report : models) n_believed += report.used ? report.n_believed : 0;
  const auto stated = [](const std::optional<double>& v) { return v ? Json(*v) : Json(nullptr); };
  return {{"los", stated(order.noise.los_m)},
          {"nlos", stated(order.noise.nlos_m)},
          {"rtk", order.floor_sigma_m},
          {"n_nlos_applied", order.noise.nlos_m ? n_believed : 0}};
}

/// The budget of an anchor's answer, of several flights through their fusion, with the base's own error.
std::optional<ErrorBudget> budget_of(const std::vector<const FlightAnswer::Anchor*>& flights,
                                     const Estimate& fused, const std::optional<double>& base_sigma_m) {
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
Json checked(const CalibrationOrder& order, const Calibration& made) {
  const auto settings = Json::parse(order.settings_json, nullptr, false);
  if (!settings.is_object() || !settings.contains("check_points")) return nullptr;
  std::vector<FieldError> errors;  // none: the request was accepted with them
  return check_points_provenance(read_check_points(settings["check_points"], errors), made, order.plane);
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
  std::map<NetworkId, std::vector<const FlightAnswer::Anchor*>> solutions;

  void add(const FlightAnswer& flight) {
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

Json profiles_provenance(const CalibrationOrder& order, bool used) {
  Json out = Json::array();
  for (const auto& kit : order.kits) {
    const bool had_profile = used && kit.version;
    out.push_back({{"kit", kit.name},
                   {"version", had_profile && *kit.version > 0 ? Json(*kit.version) : Json(nullptr)},
                   {"n_flights", had_profile ? kit.n_flights : 0}});
  }
  return out;
}

Json models_provenance(const CalibrationOrder& order, const std::vector<FlightModelsReport>& reports) {
  if (reports.empty()) return nullptr;
  ModelRegistry::Active named;
  named.models = order.models;
  named.correction = order.correction;
  return flight_models_json(named, reports);
}

/// Positions without the models, where they changed anything and are to be compared.
bool compared(const CalibrationOrder& order) {
  return order.compare_uncorrected &&
         std::ranges::any_of(order.reports, [](const auto& report) { return report.spoke(); });
}

}  // namespace

/// Those that applied, by id: which rows they are is in the record, and the digest says that it is that
/// record.
std::string exclusions_json(const std::vector<Exclusion>& exclusions) {
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
  return to_wire(Json{{"items", std::move(items)}, {"sha256", none ? Json(nullptr) : Json(digest.hex())}});
}

std::vector<Mission> missions_of(const CalibrationOrder& order) {
  std::vector<Mission> out;
  for (const auto& flight : order.flights) {
    Mission& mission = out.emplace_back();
    mission.id = flight.id;
    mission.name = flight.name;
    mission.kit = flight.kit;
  }
  return out;
}

Result<Calibration> record_of(const CalibrationOrder& order, CalibrationAnswer answer) {
  Calibration out;
  out.frame = order.frame;
  out.origin = order.origin;
  out.settings = {order.settings_json};
  std::optional<CalibrationFrame> frame;
  if (order.local_frame) {
    auto definition = frame_definition(*order.local_frame);
    if (!definition)
      return make_error(Errc::invalid_argument, "the frame " + order.local_frame->name + " has no fit");
    frame = {*order.local_frame, *std::move(definition)};
  }
  ByAnchor by_anchor;
  std::map<NetworkId, std::vector<Estimate>> raw;
  Evidence evidence;
  evidence.course = std::move(answer.course);
  Json flights = Json::array();
  for (std::size_t i = 0; i < order.n_answered; ++i) {
    auto& flight = answer.flights[i];
    flight.evidence.name = order.flights[i].name;
    flight.evidence.kit = order.flights[i].kit;
    out.missions.push_back(order.flights[i].id);
    flights.push_back(flight_provenance(order, i, flight));
    if (!flight.copy_of) {
      by_anchor.add(flight);
      for (const auto& estimate : flight.uncorrected) raw[estimate.anchor].push_back(estimate);
    }
    evidence.flights.push_back(std::move(flight.evidence));
  }
  Json budgets = fuse_anchors(by_anchor, order.base_sigma_m, frame, out);
  Json uncorrected = compared(order) ? Json::array() : Json(nullptr);
  for (const auto& [id, estimates] : raw)
    uncorrected.push_back(without_models(fuse_estimates(estimates), out));
  const Json outline = Json::parse(order.outline_json, nullptr, false);
  out.provenance = {to_wire(
      Json{{"profiles", profiles_provenance(order, profiles_used(order.use_profile, answer.models))},
           {"base", Json::parse(order.base_json, nullptr, false)},
           {"budgets", std::move(budgets)},
           {"check_points", checked(order, out)},
           {"n_priors", order.n_priors},
           {"n_clues", order.n_priors},  // up to 0.1; with the one below, for clients of that contract
           {"frame", frame ? frame_provenance(*frame, out) : Json(nullptr)},
           {"priors", {{"outline", outline}}},
           {"clues", {{"outline", outline}}},
           {"sigma_m", noise_provenance(order, answer.models)},
           {"models", models_provenance(order, answer.models)},
           {"uncorrected", std::move(uncorrected)},
           {"flights", std::move(flights)}})};
  out.evidence = {evidence_json(evidence)};
  return out;
}

}  // namespace anchord::api
