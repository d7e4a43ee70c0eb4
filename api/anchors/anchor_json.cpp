#include "api/anchors/anchor_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "api/anchors/anchor_goals.hpp"
#include "api/formats/csv_text.hpp"
#include "api/kit/or_null.hpp"
#include "api/wire/live_writer.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

double rounded(double value, double steps) { return std::round(value * steps) / steps; }
double metres(double value) { return rounded(value, 1e4); }

Ordered vector_json(const Eigen::Vector3d& v) { return {metres(v.x()), metres(v.y()), metres(v.z())}; }

/// RFC 7946: longitude, latitude, ellipsoidal height; 9 decimals are a tenth of a millimetre.
Ordered coordinates(const Wgs84& at) {
  return {rounded(at.lon_deg, 1e9), rounded(at.lat_deg, 1e9), metres(at.height_m)};
}

Ordered point(const std::optional<Wgs84>& at) {
  if (!at) return nullptr;
  return {{"type", "Point"}, {"coordinates", coordinates(*at)}};
}

std::size_t n_refused(const Estimate& estimate) {
  std::size_t sum = 0;
  for (const auto& [reason, n] : estimate.refused) sum += n;
  return sum;
}

Ordered spread(const Eigen::Matrix3d& c, double h95_m, double v95_m) {
  const ErrorEllipse ellipse = error_ellipse(c);
  const auto sigma = [&](int i) { return metres(std::sqrt(std::max(0.0, c(i, i)))); };
  return {{"sigma_e_m", sigma(0)},
          {"sigma_n_m", sigma(1)},
          {"sigma_u_m", sigma(2)},
          {"cov_enu_m2", {c(0, 0), c(0, 1), c(0, 2), c(1, 1), c(1, 2), c(2, 2)}},
          {"ellipse95",
           {{"major_m", metres(ellipse.major_m)},
            {"minor_m", metres(ellipse.minor_m)},
            {"azimuth_deg", rounded(ellipse.azimuth_deg, 10)}}},
          {"h95_m", metres(h95_m)},
          {"v95_m", metres(v95_m)}};
}

Ordered accuracy(const Estimate& estimate, TrackFrame frame, const std::optional<Site>& site,
                 const std::optional<GlobeAccuracy>& globe) {
  if (!estimate.best || !estimate.best->covariance_m2.allFinite()) return nullptr;
  Ordered out{{"relative", spread(estimate.best->covariance_m2, estimate.h95_m, estimate.v95_m)}};
  out["globe"] = globe ? spread(globe->covariance_m2, globe->h95_m, globe->v95_m) : Ordered(nullptr);
  out["absolute"] = nullptr;
  // Local metres say nothing of the globe until a frame does.
  if (site && site->base_sigma_m && (frame == TrackFrame::wgs84 || globe)) {
    // The base's own coordinates err alike for all anchors: 95 % of it in the plane is 2.4477 sigma,
    // upwards 1.96.
    const double s = *site->base_sigma_m;
    out["absolute"] = {{"h95_m", metres(std::hypot(globe ? globe->h95_m : estimate.h95_m, 2.4477 * s))},
                       {"v95_m", metres(std::hypot(globe ? globe->v95_m : estimate.v95_m, 1.96 * s))}};
  }
  return out;
}

Ordered quality(const Estimate& estimate, const std::optional<Override>& overridden) {
  Ordered gates = Ordered::array();
  for (const auto& gate : estimate.gates) gates.push_back(gate_json(gate));
  return {
      {"verdict", k_verdict_words.word(estimate.verdict)},
      {"reason", estimate.reason},
      {"gdop", or_null(estimate.gdop)},
      {"gdop_trace", or_null(estimate.gdop_trace)},
      {"n_ranges", estimate.n_used},
      {"n_refused", n_refused(estimate)},
      {"refused", estimate.refused},
      {"rms_residual_m", estimate.best ? Ordered(metres(estimate.best->rms_residual_m)) : Ordered(nullptr)},
      {"bias_m", or_null(estimate.bias_m)},
      {"bias_sigma_m", or_null(estimate.bias_sigma_m)},
      {"lag_s", or_null(estimate.lag_s)},
      {"lag_sigma_s", or_null(estimate.lag_sigma_s)},
      {"acceptable", estimate.acceptable()},
      {"gates", std::move(gates)},
      {"override",
       overridden ? Ordered{{"reason", overridden->reason}, {"by", overridden->by}} : Ordered(nullptr)}};
}

Ordered mirror(const Estimate& estimate) {
  if (!estimate.mirror) return nullptr;
  return {{"coordinates", estimate.mirror->wgs84 ? coordinates(*estimate.mirror->wgs84) : Ordered(nullptr)},
          {"enu_m", vector_json(estimate.mirror->position.m)},
          {"probability", rounded(estimate.mirror->probability, 1e3)}};
}

/// Frame of the base as far as the site says; null is "unknown", never a guess.
Ordered crs(const AnchorFeature& feature) {
  if (feature.frame != TrackFrame::wgs84) return nullptr;
  const Site site = feature.site.value_or(Site{});
  return {{"id", "EPSG:4979"},
          {"frame", text_or_null(site.crs_frame)},
          {"epoch", or_null(site.crs_epoch)},
          {"base", {{"source", text_or_null(site.base_source)}, {"sigma_m", or_null(site.base_sigma_m)}}}};
}

std::string number(double value, int decimals) {
  char text[64];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

}  // namespace

UtcTime newest_calibration(std::span<const AnchorFeature> anchors) {
  UtcTime newest{};
  for (const auto& feature : anchors) {
    if (feature.calibrated && newest < *feature.calibrated) newest = *feature.calibrated;
  }
  return newest;
}

std::optional<GlobeAccuracy> map_accuracy(const AnchorFeature& feature) {
  if (feature.globe) return feature.globe;
  if (!feature.estimate || !feature.estimate->best) return std::nullopt;
  const Estimate& e = *feature.estimate;
  return GlobeAccuracy{e.best->covariance_m2, e.h95_m, e.v95_m};
}

std::optional<GlobeAccuracy> globe_accuracy(const Ordered& provenance, NetworkId anchor) {
  const Ordered::json_pointer at("/frame/globe/" + to_string(anchor));
  if (!provenance.is_object() || !provenance.contains(at) || !provenance[at].is_object()) return std::nullopt;
  const Ordered& told = provenance[at];
  const auto c = told.value("cov_enu_m2", std::vector<double>{});
  if (c.size() != 6) return std::nullopt;
  GlobeAccuracy out;
  out.covariance_m2 << c[0], c[1], c[2], c[1], c[3], c[4], c[2], c[4], c[5];
  out.h95_m = told.value("h95_m", 0.0);
  out.v95_m = told.value("v95_m", 0.0);
  return out;
}

Ordered gate_json(const Gate& gate) {
  const auto finite = [](double v) { return std::isfinite(v) ? Ordered(v) : Ordered(nullptr); };
  return {{"name", gate.name},
          {"value", gate.value ? finite(*gate.value) : Ordered(nullptr)},
          {"limit", finite(gate.limit)},
          {"passed", gate.passed},
          {"why", gate.why}};
}

Ordered estimate_result_json(const Estimate& estimate, TrackFrame frame, const std::optional<Site>& site,
                             const std::optional<Override>& overridden,
                             const std::optional<GlobeAccuracy>& globe) {
  Ordered out{{"network_id", to_string(estimate.anchor)},
              {"verdict", k_verdict_words.word(estimate.verdict)},
              {"reason", estimate.reason}};
  out["geometry"] = point(estimate.best ? estimate.best->wgs84 : std::nullopt);
  out["enu_m"] = estimate.best ? vector_json(estimate.best->position.m) : Ordered(nullptr);
  out["local_m"] =
      estimate.best && frame == TrackFrame::local ? vector_json(estimate.best->position.m) : Ordered(nullptr);
  out["accuracy"] = accuracy(estimate, frame, site, globe);
  out["quality"] = quality(estimate, overridden);
  out["mirror"] = mirror(estimate);
  return out;
}

Ordered anchor_feature_json(const AnchorFeature& feature) {
  const Anchor& anchor = feature.anchor;
  const auto& estimate = feature.estimate;
  const bool placed = estimate && estimate->best;
  Ordered external = Ordered::array(), missions = Ordered::array();
  for (const auto& [system, id] : anchor.external_ids) external.push_back({{"system", system}, {"id", id}});
  for (const auto& id : feature.missions) missions.push_back(to_string(id));
  Ordered p{{"network_id", to_string(anchor.network_id)},
            {"name", anchor.name},
            {"status", feature.status},
            {"revision", or_null(feature.revision)}};
  p["calibrated_at"] = feature.calibrated ? Ordered(to_rfc3339(*feature.calibrated)) : Ordered(nullptr);
  p["contradiction"] = feature.contradicted ? Ordered::parse(feature.contradicted->json) : Ordered(nullptr);
  p["site"] = anchor.site ? Ordered(to_string(*anchor.site)) : Ordered(nullptr);
  p["building"] = anchor.building;
  p["floor"] = anchor.floor;
  p["space"] = anchor.space;
  p["asset_tag"] = anchor.asset_tag;
  p["ifc_guid"] = anchor.ifc_guid;
  p["external_ids"] = std::move(external);
  p["retired"] = anchor.retired;
  p["crs"] = crs(feature);
  const bool orthometric = feature.height_orthometric_m.has_value();
  p["height_orthometric_m"] = orthometric ? Ordered(metres(*feature.height_orthometric_m)) : Ordered(nullptr);
  p["geoid"] = orthometric ? Ordered(feature.geoid) : Ordered(nullptr);
  p["geoid_reason"] = orthometric || feature.geoid.empty() ? Ordered(nullptr) : Ordered(feature.geoid);
  p["projected"] = nullptr;
  if (feature.projected)
    p["projected"] = {{"epsg", feature.projected->epsg},
                      {"e_m", rounded(feature.projected->e_m, 1e3)},
                      {"n_m", rounded(feature.projected->n_m, 1e3)}};
  p["projected_reason"] = text_or_null(feature.projected_reason);
  p["enu_m"] = placed ? vector_json(estimate->best->position.m) : Ordered(nullptr);
  p["local_m"] = placed && feature.frame == TrackFrame::local ? vector_json(estimate->best->position.m)
                 : feature.local_m                            ? vector_json(*feature.local_m)
                                                              : Ordered(nullptr);
  p["accuracy"] =
      estimate ? accuracy(*estimate, feature.frame, feature.site, feature.globe) : Ordered(nullptr);
  p["quality"] = estimate ? quality(*estimate, feature.overridden) : Ordered(nullptr);
  p["goal"] = estimate && feature.goal ? anchor_goal_json(*feature.goal, *estimate) : Ordered(nullptr);
  p["budget"] = feature.budget_json.empty() ? Ordered(nullptr) : Ordered::parse(feature.budget_json);
  p["provenance"] = {
      {"calibration", feature.calibration ? Ordered(to_string(*feature.calibration)) : Ordered(nullptr)},
      {"missions", std::move(missions)}};
  p["mirror"] = estimate ? mirror(*estimate) : Ordered(nullptr);
  const std::string self = "/api/v1/anchors/" + to_string(anchor.network_id);
  p["links"] = Ordered::array({{{"rel", "history"}, {"href", self + "/history"}}});
  if (anchor.site)
    p["links"].push_back({{"rel", "site"}, {"href", "/api/v1/sites/" + to_string(*anchor.site)}});
  Ordered out{{"type", "Feature"}};
  if (!(anchor.id == AnchorId{})) out["id"] = to_string(anchor.id);  // absent: not stored yet
  out["geometry"] = point(placed ? estimate->best->wgs84 : std::nullopt);
  out["properties"] = std::move(p);
  return out;
}

Ordered flat_feature_json(const AnchorFeature& feature) {
  Ordered full = anchor_feature_json(feature);
  Ordered flat;
  for (const char* key : {"network_id", "name", "status", "revision", "calibrated_at", "site", "building",
                          "floor", "space", "asset_tag", "ifc_guid"})
    flat[key] = full["properties"][key];
  const auto& estimate = feature.estimate;
  flat["verdict"] = estimate ? Ordered(k_verdict_words.word(estimate->verdict)) : Ordered(nullptr);
  const auto place = map_accuracy(feature);
  flat["h95_m"] = place ? Ordered(metres(place->h95_m)) : Ordered(nullptr);
  flat["v95_m"] = place ? Ordered(metres(place->v95_m)) : Ordered(nullptr);
  flat["acceptable"] = estimate ? Ordered(estimate->acceptable()) : Ordered(nullptr);
  flat["contradiction"] = feature.contradicted ? Ordered(feature.contradicted->text) : Ordered(nullptr);
  flat["override_reason"] = feature.overridden ? Ordered(feature.overridden->reason) : Ordered(nullptr);
  flat["e_m"] = feature.projected ? Ordered(rounded(feature.projected->e_m, 1e3)) : Ordered(nullptr);
  flat["n_m"] = feature.projected ? Ordered(rounded(feature.projected->n_m, 1e3)) : Ordered(nullptr);
  flat["epsg"] = feature.projected ? Ordered(feature.projected->epsg) : Ordered(nullptr);
  flat["frame"] =
      full["properties"]["crs"].is_object() ? full["properties"]["crs"]["frame"] : Ordered(nullptr);
  full["properties"] = std::move(flat);
  return full;
}

Ordered published_json(const PublishedPosition& position, const std::optional<GlobeAccuracy>& globe) {
  Ordered out{{"revision", position.since_revision},
              {"published_at", to_rfc3339(position.published)},
              {"calibration", to_string(position.calibration)}};
  out.update(
      estimate_result_json(position.estimate, position.frame, std::nullopt, position.overridden, globe));
  return out;
}

std::string anchors_csv_header() {
  return "id,network_id,name,status,revision,calibrated_at,site,building,floor,space,asset_tag,ifc_guid,lon,"
         "lat,h_m,local_x_m,local_y_m,local_z_m,"
         "sigma_e_m,sigma_n_m,sigma_u_m,ellipse95_major_m,ellipse95_minor_m,ellipse95_azimuth_deg,h95_m,v95_"
         "m,verdict,frame,epoch,epsg,e_m,n_m,height_orthometric_m,geoid,gates_failed,override_reason";
}

std::string anchor_csv_row(const AnchorFeature& feature) {
  const Anchor& a = feature.anchor;
  std::string row = (a.id == AnchorId{} ? "" : to_string(a.id)) + ',' + to_string(a.network_id);
  const auto add = [&row](std::string_view cell) {
    row += ',';
    row += cell;
  };
  add(csv_text(a.name));
  add(feature.status);
  add(feature.revision ? std::to_string(*feature.revision) : "");
  add(feature.calibrated ? to_rfc3339(*feature.calibrated) : "");
  add(a.site ? to_string(*a.site) : "");
  for (const auto* text : {&a.building, &a.floor, &a.space, &a.asset_tag, &a.ifc_guid}) add(csv_text(*text));
  const auto& estimate = feature.estimate;
  const bool placed = estimate && estimate->best;
  const auto& at = placed ? estimate->best->wgs84 : std::optional<Wgs84>{};
  add(at ? number(at->lon_deg, 9) : "");
  add(at ? number(at->lat_deg, 9) : "");
  add(at ? number(at->height_m, 4) : "");
  for (int i = 0; i < 3; ++i)
    add(placed && feature.frame == TrackFrame::local ? number(estimate->best->position.m[i], 4)
        : feature.local_m                            ? number((*feature.local_m)[i], 4)
                                                     : "");
  const GlobeAccuracy place = map_accuracy(feature).value_or(GlobeAccuracy{});
  for (int i = 0; i < 3; ++i)
    add(placed ? number(std::sqrt(std::max(0.0, place.covariance_m2(i, i))), 4) : "");
  const ErrorEllipse ellipse = placed ? error_ellipse(place.covariance_m2) : ErrorEllipse{};
  for (const double value : {ellipse.major_m, ellipse.minor_m}) add(placed ? number(value, 4) : "");
  add(placed ? number(ellipse.azimuth_deg, 1) : "");
  add(placed ? number(place.h95_m, 4) : "");
  add(placed ? number(place.v95_m, 4) : "");
  add(estimate ? k_verdict_words.word(estimate->verdict) : "");
  add(feature.site ? csv_text(feature.site->crs_frame) : "");
  add(feature.site && feature.site->crs_epoch ? number(*feature.site->crs_epoch, 2) : "");
  add(feature.projected ? std::to_string(feature.projected->epsg) : "");
  add(feature.projected ? number(feature.projected->e_m, 3) : "");
  add(feature.projected ? number(feature.projected->n_m, 3) : "");
  add(feature.height_orthometric_m ? number(*feature.height_orthometric_m, 3) : "");
  add(feature.height_orthometric_m ? csv_text(feature.geoid) : "");
  std::string failed;
  for (const auto& gate : estimate ? estimate->gates : std::vector<Gate>{}) {
    if (!gate.passed) failed += (failed.empty() ? "" : " ") + gate.name;
  }
  add(csv_text(failed));
  add(feature.overridden ? csv_text(feature.overridden->reason) : "");
  return row;
}

}  // namespace anchord::api
