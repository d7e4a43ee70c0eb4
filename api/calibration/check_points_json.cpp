#include "api/calibration/check_points_json.hpp"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/geo/enu.hpp"

namespace anchord::api {
namespace {

using Json = nlohmann::json;

double metres(double value) { return std::round(value * 1e4) / 1e4; }

Json vector_json(const Eigen::Vector3d& v) { return {metres(v.x()), metres(v.y()), metres(v.z())}; }

Json finite(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

SurveyedPoint read_point(const Json& json, const std::string& at, std::vector<FieldError>& errors) {
  SurveyedPoint point;
  Fields fields(json, at, errors);
  const auto text = fields.text("network_id", 20, true);
  if (text) {
    if (const auto id = parse_network_id(*text))
      point.anchor = id.value();
    else
      errors.push_back({at + "/network_id", "bad_id", id.error().message});
  }
  const auto lon = fields.number("lon", -180, 180), lat = fields.number("lat", -90, 90);
  const auto height = fields.number("h_m", -1000, 9000);
  const auto local = fields.numbers("local_m", 3, -1e6, 1e6);
  if (const auto sigma = fields.number("sigma_h_m", 1e-4, 100)) point.sigma_h_m = *sigma;
  if (const auto sigma = fields.number("sigma_v_m", 1e-4, 100)) point.sigma_v_m = *sigma;
  fields.finish();
  if (lon && lat && height) point.globe = Wgs84{*lat, *lon, *height};
  if (local) point.local_m = Eigen::Vector3d((*local)[0], (*local)[1], (*local)[2]);
  if (point.globe.has_value() == point.local_m.has_value())
    errors.push_back({at, "required", "give lon, lat and h_m (ellipsoidal), or local_m"});
  return point;
}

}  // namespace

std::vector<SurveyedPoint> read_check_points(const Json& list, std::vector<FieldError>& errors) {
  std::vector<SurveyedPoint> out;
  if (!list.is_array() || list.empty() || list.size() > 1000) {
    errors.push_back({"/check_points", "wrong_type", "must be an array of 1 to 1000 surveyed points"});
    return out;
  }
  for (std::size_t i = 0; i < list.size(); ++i)
    out.push_back(read_point(list[i], "/check_points/" + std::to_string(i), errors));
  return out;
}

Json check_points_provenance(const std::vector<SurveyedPoint>& points, const Calibration& calibration,
                             bool plane) {
  if (points.empty()) return nullptr;
  std::vector<CheckPoint> pairs;
  Json missing = Json::array();
  for (const auto& point : points) {
    const auto at = std::ranges::find(calibration.anchors, point.anchor, &Estimate::anchor);
    const bool globe = calibration.frame == TrackFrame::wgs84 && calibration.origin.has_value();
    if (at == calibration.anchors.end() || !at->best || (globe ? !point.globe : !point.local_m)) {
      missing.push_back(to_string(point.anchor));
      continue;
    }
    CheckPoint pair{point.anchor, {}, {at->best->position.m, at->best->covariance_m2}, plane};
    pair.surveyed.at_m =
        globe ? EnuFrame(*calibration.origin).enu_from_wgs84(*point.globe).m : *point.local_m;
    pair.surveyed.covariance_m2.diagonal() << point.sigma_h_m * point.sigma_h_m,
        point.sigma_h_m * point.sigma_h_m, point.sigma_v_m * point.sigma_v_m;
    pairs.push_back(pair);
  }
  const CheckReport report = check_against(pairs);
  Json items = Json::array();
  for (const auto& m : report.points)
    items.push_back({{"network_id", to_string(m.anchor)},
                     {"delta_enu_m", vector_json(m.delta_m)},
                     {"horizontal_m", metres(m.delta_m.head<2>().norm())},
                     {"vertical_m", m.plane ? Json(nullptr) : Json(metres(m.delta_m.z()))},
                     {"chi2", finite(m.chi2)},
                     {"chi2_limit", m.limit},
                     {"p_value", finite(m.p_value)},
                     {"agrees", m.agrees}});
  Json shift = nullptr;
  if (report.shift) {
    const auto& s = *report.shift;
    const auto sigma = [&](int i) { return metres(std::sqrt(std::max(s.covariance_m2(i, i), 0.0))); };
    shift = {{"shift_enu_m", vector_json(s.shift_m)},
             {"sigma_enu_m", {sigma(0), sigma(1), sigma(2)}},
             {"chi2", finite(s.chi2)},
             {"chi2_limit", s.limit},
             {"p_value", finite(s.p_value)},
             {"significant", s.significant}};
  }
  return {{"points", std::move(items)}, {"not_found", std::move(missing)}, {"shift", std::move(shift)}};
}

}  // namespace anchord::api
