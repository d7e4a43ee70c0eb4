#include "api/calibration/solve_output.hpp"
#include "api/learning/flight_models.hpp"
#include "api/wire/budget_json.hpp"
#include "api/wire/live_writer.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "api/calibration/solve_table.hpp"
#include "core/base/to_wire.hpp"
#include "core/localize/error_ellipse.hpp"

namespace anchord {
namespace {

using Ordered = nlohmann::ordered_json;

/// A number with so many decimals, null where there is none.
Ordered number(double value, int decimals) {
  if (!std::isfinite(value)) return nullptr;
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return std::strtod(text, nullptr);  // prints back with at most these decimals
}
Ordered number(const std::optional<double>& value, int decimals) {
  return value ? number(*value, decimals) : Ordered(nullptr);
}
Ordered valued(const Valued& v) { return {{"value", number(v.value, 5)}, {"sigma", number(v.sigma, 5)}}; }

Ordered vector_of(const Eigen::Vector3d& v) { return {number(v.x(), 4), number(v.y(), 4), number(v.z(), 4)}; }

void put_place(Ordered& json, const Hypothesis& h, bool globe) {
  json["lon"] = h.wgs84 ? number(h.wgs84->lon_deg, 9) : Ordered(nullptr);
  json["lat"] = h.wgs84 ? number(h.wgs84->lat_deg, 9) : Ordered(nullptr);
  json["h_m"] = h.wgs84 ? number(h.wgs84->height_m, 4) : Ordered(nullptr);
  json["enu_m"] = vector_of(h.position.m);
  if (!globe) {
    json["x_m"] = number(h.position.m.x(), 4);
    json["y_m"] = number(h.position.m.y(), 4);
    json["z_m"] = number(h.position.m.z(), 4);
  }
}

Ordered search_json(const StartSearch& search) {
  Ordered json = {
      {"n_starts", search.n_starts}, {"n_settled", search.n_settled}, {"places", Ordered::array()}};
  for (const auto& place : search.places) {
    json["places"].push_back({{"enu_m", vector_of(place.position_m)},
                              {"cost", number(place.cost, 3)},
                              {"n_starts", place.n_starts},
                              {"n_settled", place.n_settled}});
  }
  return json;
}

/// Positions of the dissertation's methods, beside which the answer is to be seen.
Ordered methods_json(const MethodAnswers& answers) {
  const auto place = [](const std::optional<Eigen::Vector3d>& at) {
    return at ? vector_of(*at) : Ordered(nullptr);
  };
  return {{"linear_enu_m", place(answers.linear_m)},
          {"wls_enu_m", place(answers.wls_m)},
          {"why", answers.why.empty() ? Ordered(nullptr) : Ordered(answers.why)}};
}

Ordered anchor_json(const AnchorSolution& anchor, bool globe) {
  const Estimate& e = anchor.estimate;
  Ordered json;
  json["anchor_id"] = anchor.name;
  json["network_id"] = to_string(e.anchor);
  json["verdict"] = k_verdict_words.word(e.verdict);
  json["determined"] = k_determined_words.word(anchor.determined);
  json["reason"] = e.reason;
  if (e.best) {
    put_place(json, *e.best, globe);
    const auto& c = e.best->covariance_m2;
    json["cov_enu_m2"] = {number(c(0, 0), 8), number(c(0, 1), 8), number(c(0, 2), 8),
                          number(c(1, 1), 8), number(c(1, 2), 8), number(c(2, 2), 8)};
    const ErrorEllipse ellipse = error_ellipse(c);
    json["ellipse95"] = {{"major_m", number(ellipse.major_m, 4)},
                         {"minor_m", number(ellipse.minor_m, 4)},
                         {"azimuth_deg", number(ellipse.azimuth_deg, 1)}};
    json["h95_m"] = number(e.h95_m, 4);
    json["v95_m"] = number(e.v95_m, 4);
    json["rms_residual_m"] = number(e.best->rms_residual_m, 4);
    json["probability"] = number(e.best->probability, 4);
  } else {
    for (const char* key : {"lon", "lat", "h_m", "enu_m", "cov_enu_m2", "ellipse95", "h95_m", "v95_m",
                            "rms_residual_m", "probability"}) {
      json[key] = nullptr;
    }
    for (const char* key : {"x_m", "y_m", "z_m"}) {
      if (!globe) json[key] = nullptr;
    }
  }
  json["mirror"] = nullptr;
  if (e.mirror) {
    Ordered mirror;
    put_place(mirror, *e.mirror, globe);
    mirror["probability"] = number(e.mirror->probability, 4);
    json["mirror"] = std::move(mirror);
  }
  json["n_ranges"] = e.n_used;
  std::size_t n_refused = 0;
  json["refused"] = Ordered::object();
  for (const auto& [why, count] : e.refused) {
    json["refused"][why] = count;
    n_refused += count;
  }
  json["n_refused"] = n_refused;
  json["gdop"] = number(e.gdop, 3);
  json["gdop_trace"] = number(e.gdop_trace, 3);
  json["bias_m"] = number(e.bias_m, 4);
  json["bias_sigma_m"] = number(e.bias_sigma_m, 4);
  json["lag_s"] = number(e.lag_s, 4);
  json["lag_sigma_s"] = number(e.lag_sigma_s, 4);
  const auto& g = anchor.geometry;
  json["geometry"] = {{"track_sd_m", vector_of(g.track_sd_m)},
                      {"median_range_m", number(g.median_range_m, 3)},
                      {"line_ratio", number(g.line_ratio, 4)},
                      {"plane_ratio", number(g.plane_ratio, 4)},
                      {"sigma_ratio", number(g.sigma_ratio, 4)}};
  json["search"] = search_json(anchor.search);
  json["budget"] = anchor.budget ? budget_json(*anchor.budget, false) : Ordered(nullptr);
  json["acceptable"] = e.acceptable();
  json["gates"] = Ordered::array();
  for (const Gate& gate : e.gates) {
    json["gates"].push_back({{"name", gate.name},
                             {"value", number(gate.value, 4)},
                             {"limit", number(gate.limit, 4)},
                             {"passed", gate.passed},
                             {"why", gate.why}});
  }
  return json;
}

Ordered flight_json(const SolvedFlight& flight) {
  const FlightSolution& s = *flight.solution;
  const Mission& mission = flight.data->mission;
  const bool globe = mission.frame == TrackFrame::wgs84;
  Ordered json;
  json["name"] = mission.name;
  json["kit"] = mission.kit;
  json["frame"] = k_frame_words.word(globe ? TrackFrame::wgs84 : TrackFrame::local);
  json["origin"] = nullptr;
  if (s.origin) {
    json["origin"] = {{"lon", number(s.origin->lon_deg, 9)},
                      {"lat", number(s.origin->lat_deg, 9)},
                      {"h_m", number(s.origin->height_m, 4)}};
  }
  json["shared"] = {{"bias_m", valued(s.shared.bias_m)},
                    {"curve_m_per_efold", valued(s.shared.curve_m)},
                    {"lag_s", valued(s.shared.lag_s)},
                    {"lever_up_m", valued(s.shared.lever_up_m)},
                    {"lever_arm_sigma_m",
                     s.shared.lever_arm_sigma_m ? number(*s.shared.lever_arm_sigma_m, 4) : Ordered(nullptr)},
                    {"range_scale", valued(s.shared.range_scale)},
                    {"range_scale_z", number(s.shared.range_scale_z, 2)},
                    {"bias_determined", s.shared.bias_determined},
                    {"bias_z", number(s.shared.bias_z, 2)}};
  json["shared"]["lever_up_by_antenna"] = Ordered::array();
  for (const auto& antenna : s.shared.lever_up_by_antenna)
    json["shared"]["lever_up_by_antenna"].push_back({{"tag_id", to_string(antenna.tag)},
                                                     {"antenna", antenna.antenna},
                                                     {"lever_up_m", valued(antenna.up_m)}});
  json["n_fixes"] = s.n_fixes;
  json["n_ranges"] = s.n_ranges;
  json["n_anchor_anchor"] = std::ranges::count(flight.data->ranges, RangeKind::anchor_anchor, &Range::kind);
  json["n_used"] = s.n_used;
  json["placed"] = s.placed;
  json["refused"] = Ordered::object();
  for (const auto& [why, count] : s.refused) json["refused"][why] = count;
  json["fixes_refused"] = Ordered::object();
  for (const auto& [why, count] : s.fixes_refused) json["fixes_refused"][why] = count;
  json["models"] =
      flight.models != nullptr ? api::flight_models_report_json(*flight.models) : Ordered(nullptr);
  json["notes"] = s.notes;
  json["anchors"] = Ordered::array();
  for (const auto& anchor : s.anchors) {
    json["anchors"].push_back(anchor_json(anchor, globe));
    const auto methods = flight.methods.find(anchor.estimate.anchor);
    json["anchors"].back()["methods"] =
        methods == flight.methods.end() ? Ordered(nullptr) : methods_json(methods->second);
  }
  return json;
}

std::string geojson(std::span<const SolvedFlight> flights) {
  Ordered all = {{"type", "FeatureCollection"}, {"features", Ordered::array()}};
  for (const auto& flight : flights) {
    const bool globe = flight.data->mission.frame == TrackFrame::wgs84;
    for (const auto& anchor : flight.solution->anchors) {
      Ordered properties = anchor_json(anchor, globe);
      properties["flight"] = flight.data->mission.name;
      Ordered geometry = nullptr;
      const auto& best = anchor.estimate.best;
      if (best && best->wgs84) {
        geometry = {{"type", "Point"},
                    {"coordinates",
                     {number(best->wgs84->lon_deg, 9), number(best->wgs84->lat_deg, 9),
                      number(best->wgs84->height_m, 4)}}};
      }
      all["features"].push_back(
          {{"type", "Feature"}, {"geometry", std::move(geometry)}, {"properties", std::move(properties)}});
    }
  }
  return to_wire(all, 1) + "\n";
}

}  // namespace

std::string solve_output(std::span<const SolvedFlight> flights, SolveFormat format) {
  switch (format) {
    case SolveFormat::table:
      return solve_table(flights);
    case SolveFormat::csv:
      return solve_csv(flights);
    case SolveFormat::geojson:
      return geojson(flights);
    case SolveFormat::json:
      break;
  }
  Ordered all = {{"schema", "anchord.solve/1"}, {"flights", Ordered::array()}};
  for (const auto& flight : flights) all["flights"].push_back(flight_json(flight));
  return to_wire(all, 1) + "\n";
}

}  // namespace anchord
