#include "api/calibration/calibration_report.hpp"

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "api/calibration/routes.hpp"
#include "api/wire/budget_json.hpp"
#include "api/wire/outline_json.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

std::string loss_words(const std::string& loss) {
  if (loss == "none") return "no range is left out for its residual";
  if (loss == "huber") return "large residuals count linearly (Huber)";
  if (loss == "cauchy") return "large residuals lose their weight (Cauchy)";
  return "large residuals count less and the largest not at all (Tukey's biweight)";
}

/// Its last characters: the first are the time it was made, and alike for all of an afternoon (RFC 9562,
/// version 7).
std::string short_id(const std::string& id) {
  return id.substr(id.size() - std::min<std::size_t>(8, id.size()));
}

std::string number(double value, int decimals) {
  char text[48];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

std::string place_of(const Anchor& anchor) {
  std::string out;
  for (const auto* part : {&anchor.building, &anchor.floor, &anchor.space}) {
    if (!part->empty()) out += (out.empty() ? "" : " ") + *part;
  }
  return out;
}

void add_profile_fact(Report& report, const Json& provenance) {
  std::string words;
  for (const auto& one : provenance.value("profiles", Json::array())) {
    const std::string kit = one.value("kit", "");
    words += (words.empty() ? "" : ", ") + kit +
             (one.contains("version") && one["version"].is_number()
                  ? " profile " + std::to_string(one["version"].get<int>()) + ", " +
                        std::to_string(one.value("n_flights", 0)) + " flights"
                  : " (no profile yet)");
  }
  report.facts.emplace_back("Kit", words.empty() ? "not named" : words);
}

void add_base_fact(Report& report) {
  std::string words = "not stated";
  if (report.site) {
    words = report.site->base_source;
    std::ranges::replace(words, '_', ' ');
    if (words.empty()) words = "source not stated";
    if (report.site->base_sigma_m) words += ", σ " + number(*report.site->base_sigma_m * 1000, 0) + " mm";
  }
  report.facts.emplace_back("Base", report.frame == TrackFrame::wgs84 ? words : "none, local frame");
  std::string datum = report.frame == TrackFrame::wgs84 ? "not stated" : "local metres";
  if (report.site && !report.site->crs_frame.empty()) {
    datum = report.site->crs_frame;
    if (report.site->crs_epoch) datum += ", epoch " + number(*report.site->crs_epoch, 2);
  }
  report.facts.emplace_back("Datum", datum);
  if (report.site && report.site->projected_epsg)
    report.facts.emplace_back("Map", "EPSG:" + std::to_string(*report.site->projected_epsg));
}

/// What surveyed points say of the answer, a sentence each.
void add_check_points(Report& report, const nlohmann::ordered_json& provenance) {
  if (!provenance.is_object() || !provenance.contains("check_points") ||
      !provenance["check_points"].is_object())
    return;
  const auto& checked = provenance["check_points"];
  const auto words = [](const nlohmann::ordered_json& v, const nlohmann::ordered_json& p) {
    const auto at = v.get<std::vector<double>>();
    std::string out = number(at.at(0), 3) + " m east, " + number(at.at(1), 3) + " m north, " +
                      number(at.at(2), 3) + " m up";
    if (p.is_number())
      out += " (probability of such a difference by chance " + number(p.get<double>(), 3) + ")";
    return out;
  };
  for (const auto& point : checked["points"])
    report.remarks.push_back("Check point " + point.value("network_id", "") + ": solved minus surveyed " +
                             words(point["delta_enu_m"], point["p_value"]) +
                             (point.value("agrees", false) ? ", agrees." : ", does not agree."));
  for (const auto& id : checked["not_found"])
    report.remarks.push_back("Check point " + id.get<std::string>() + " has no position here.");
  if (checked["shift"].is_object())
    report.remarks.push_back("All check points together differ by " +
                             words(checked["shift"]["shift_enu_m"], checked["shift"]["p_value"]) +
                             (checked["shift"].value("significant", false)
                                  ? ": check the coordinates of the base station, their datum and epoch."
                                  : ", which may be chance."));
}

}  // namespace

void describe(Report& report, const std::vector<Mission>& missions, const std::string& settings_json) {
  std::size_t ranges = 0, used = 0, fixes = 0;
  for (const auto& flight : report.evidence.flights) {
    ranges += flight.n_ranges;
    used += flight.n_used;
    fixes += flight.n_fixes;
    if (!flight.shared.bias_determined)
      report.remarks.push_back(flight.name +
                               " does not determine its own range bias, and there is no profile of the kit "
                               "that gives it: the regions include this uncertainty.");
  }
  report.methods.push_back(std::to_string(missions.size()) +
                           (missions.size() == 1 ? " flight, " : " flights, ") + std::to_string(ranges) +
                           " ranges and " + std::to_string(fixes) + " positions of the tag; " +
                           std::to_string(used) + " ranges are used.");
  const Json settings = Json::parse(settings_json, nullptr, false);
  const bool plane = settings.is_object() && settings.value("dims", Json()) == 2;
  std::string loss = "tukey", weights = "inverse_variance";
  if (settings.is_object()) {
    if (settings.value("weights", Json()).is_string()) weights = settings["weights"].get<std::string>();
    if (settings.contains("loss") && settings["loss"].is_object())
      loss = settings["loss"].value("type", loss);
  }
  report.methods.push_back(
      std::string(
          "Positions, range bias, range curve, time lag and antenna offset are solved together by robust "
          "weighted least squares in ") +
      (plane ? "the plane" : "three dimensions") +
      (weights == "dissertation" ? ". Ranges are weighted as the dissertation prints it (7.2.3); "
                                 : ". Ranges are weighted by the inverse of their variance; ") +
      loss_words(loss) + "; their scale is that of the residuals, and so is that of the covariances.");
  report.methods.emplace_back(
      "95 % regions: Gaussian, from the scaled covariance with at least 4 cm per axis for errors that no "
      "residual shows.");
  const auto good = static_cast<std::size_t>(
      std::ranges::count_if(report.anchors, [](const ReportAnchor& a) { return a.estimate.acceptable(); }));
  report.remarks.push_back(std::to_string(good) + " of " + std::to_string(report.anchors.size()) +
                           " anchors pass every acceptance gate.");
  std::size_t asked = 0;
  std::string over;
  for (const auto& anchor : report.anchors) {
    if (!anchor.goal || !anchor.estimate.best) continue;
    ++asked;
    if (!within(*anchor.goal, anchor.estimate))
      over += (over.empty() ? "" : ", ") +
              (anchor.name.empty() ? to_string(anchor.estimate.anchor) : anchor.name);
  }
  if (asked > 0)
    report.remarks.push_back(over.empty() ? "Every position is within its accuracy goal."
                                          : "Outside the accuracy goal (see the next page): " + over + ".");
  for (const auto& anchor : report.anchors) {
    if (!anchor.estimate.mirror) continue;
    report.remarks.push_back(
        (anchor.name.empty() ? to_string(anchor.estimate.anchor) : anchor.name) + " has a mirror solution, " +
        number((anchor.estimate.best->position.m - anchor.estimate.mirror->position.m).norm(), 2) +
        " m away (probability " + number(anchor.estimate.mirror->probability, 2) + ").");
  }
}

ReportBudget report_budget(const nlohmann::ordered_json& budget) {
  ReportBudget out;
  if (!budget.is_object()) return out;
  for (const auto& [source, one] : budget["sources"].items()) {
    if (one.is_object()) out.shares.emplace_back(source, one.value("share", 0.0));
  }
  out.help = budget.value("help_text", "");
  return out;
}

Result<Report> calibration_report(CalibrationApi& api, const Calibration& calibration) {
  Report report;
  report.program = api.program;
  report.calibration = to_string(calibration.id);
  report.created = calibration.created;
  report.frame = calibration.frame;
  report.origin = calibration.origin;
  BOOST_OUTCOME_TRY(const auto evidence, api.calibration_store.evidence(calibration.id));
  if (!evidence.empty()) {
    BOOST_OUTCOME_TRY(report.evidence, parse_evidence(evidence));
  }
  std::vector<Mission> missions;
  for (const auto& id : calibration.missions) {
    BOOST_OUTCOME_TRY(auto mission, api.mission_store.mission(id));
    report.subtitle += (report.subtitle.empty() ? "" : ", ") + mission.name;
    if (!report.site && mission.site) {
      BOOST_OUTCOME_TRY(report.site, api.sites.site(*mission.site));
    }
    missions.push_back(std::move(mission));
  }
  if (report.site) {
    report.subtitle = report.site->name + ": " + report.subtitle;
    if (report.origin) report.outline_m = outline_in_enu(report.site->outline, *report.origin);
  }
  BOOST_OUTCOME_TRY(const auto revisions, api.revisions.revisions(1000, 0));
  std::map<NetworkId, PublishedPosition> published;
  report.heading = "Not published";
  for (const auto& revision : revisions) {
    if (revision.calibration != calibration.id) continue;
    if (published.empty()) report.heading = "Revision " + std::to_string(revision.number);
    BOOST_OUTCOME_TRY(const auto positions, api.revisions.published(revision.number));
    for (const auto& position : positions) {
      if (position.since_revision == revision.number) published.emplace(position.estimate.anchor, position);
    }
  }
  const auto told = nlohmann::ordered_json::parse(calibration.provenance.text, nullptr, false);
  const auto flown = api.goals.flown(calibration.missions);
  for (const auto& estimate : calibration.anchors) {
    ReportAnchor anchor;
    anchor.budget = report_budget(kept_budget(told, estimate.anchor));
    anchor.estimate = estimate;
    anchor.goal = api.goals.of(estimate.anchor, flown);
    if (const auto known = api.anchors.anchor(estimate.anchor)) {
      anchor.name = known.value().name;
      anchor.place = place_of(known.value());
    }
    if (const auto at = published.find(estimate.anchor); at != published.end()) {
      anchor.published = true;
      anchor.overridden = at->second.overridden;
    }
    report.anchors.push_back(std::move(anchor));
  }
  std::string flights;
  for (const auto& mission : missions)
    flights += (flights.empty() ? "" : ", ") + short_id(to_string(mission.id));
  report.facts.emplace_back(missions.size() == 1 ? "Mission" : "Missions", flights);
  add_base_fact(report);
  const Json provenance = Json::parse(calibration.provenance.text, nullptr, false);
  if (provenance.is_object()) add_profile_fact(report, provenance);
  report.facts.emplace_back("Calibration", short_id(report.calibration));
  describe(report, missions, calibration.settings.text);
  add_check_points(report, told);
  return report;
}

}  // namespace anchord::api
