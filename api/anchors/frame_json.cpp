#include "api/anchors/frame_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

Ordered offset_json(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Eigen::Vector3d vector_of(const Json& json) {
  return {json.at(0).get<double>(), json.at(1).get<double>(), json.at(2).get<double>()};
}

Ordered origin_json(const Wgs84& at) {
  return {{"lon", at.lon_deg}, {"lat", at.lat_deg}, {"h_m", at.height_m}};
}

Ordered matrix_json(const Eigen::Matrix3d& m) {
  Ordered out = Ordered::array();
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) out.push_back(m(r, c));
  }
  return out;
}

FrameFit fit_of(const Json& json) {
  FrameFit fit;
  fit.transform.model = json.at("parameters").get<int>() == 4 ? FrameModel::four : FrameModel::seven;
  fit.transform.scale = json.at("scale").get<double>();
  fit.transform.shift_m = vector_of(json.at("shift_m"));
  for (int i = 0; i < 9; ++i)
    fit.transform.enu_from_local(i / 3, i % 3) =
        json.at("enu_from_local").at(static_cast<std::size_t>(i)).get<double>();
  fit.centroid_local_m = vector_of(json.at("centroid_local_m"));
  fit.rms_m = json.at("rms_m").get<double>();
  fit.dof = json.at("dof").get<int>();
  if (json.at("covariance").is_array()) {
    fit.covariance.emplace();
    for (int i = 0; i < 49; ++i)
      (*fit.covariance)(i / 7, i % 7) = json.at("covariance").at(static_cast<std::size_t>(i)).get<double>();
  }
  return fit;
}

}  // namespace

Ordered frame_fit_json(const FrameFit& fit, const std::vector<FramePair>& pairs) {
  const auto& t = fit.transform;
  Ordered out{{"parameters", t.model == FrameModel::four ? 4 : 7},
              {"scale", t.scale},
              {"yaw_deg", t.yaw_deg()},
              {"tilt_deg", t.tilt_deg()},
              {"shift_m", offset_json(t.shift_m)},
              {"enu_from_local", matrix_json(t.enu_from_local)},
              {"centroid_local_m", offset_json(fit.centroid_local_m)},
              {"rms_m", fit.rms_m},
              {"dof", fit.dof}};
  out["covariance"] = nullptr;
  out["sigma"] = nullptr;
  if (fit.covariance) {
    const auto& c = *fit.covariance;
    Ordered all = Ordered::array();
    for (int i = 0; i < 49; ++i) all.push_back(c(i / 7, i % 7));
    out["covariance"] = std::move(all);
    const auto sigma = [&](int i) { return std::sqrt(std::max(0.0, c(i, i))); };
    out["sigma"] = {{"shift_m", {sigma(0), sigma(1), sigma(2)}},
                    {"yaw_deg", sigma(5) * 57.29577951308232},
                    {"scale", sigma(6)}};
  }
  Ordered residuals = Ordered::array();
  for (std::size_t i = 0; i < fit.residuals.size() && i < pairs.size(); ++i) {
    const auto& r = fit.residuals[i];
    residuals.push_back({{"name", pairs[i].name},
                         {"residual_m", offset_json(r.residual_m)},
                         {"left_out_m", r.left_out_m ? offset_json(*r.left_out_m) : Ordered(nullptr)}});
  }
  out["residuals"] = std::move(residuals);
  out["notes"] = fit.notes;
  return out;
}

std::string frame_definition_json(const FrameDefinition& definition) {
  Ordered pairs = Ordered::array();
  for (const auto& pair : definition.pairs)
    pairs.push_back({{"name", pair.name},
                     {"local_m", offset_json(pair.local_m)},
                     {"enu_m", offset_json(pair.enu_m)},
                     {"sigma_m", pair.sigma_m ? Ordered(*pair.sigma_m) : Ordered(nullptr)}});
  return to_wire(Ordered{{"origin", origin_json(definition.origin)},
                         {"fitted_at", to_rfc3339(definition.fitted)},
                         {"pairs", std::move(pairs)},
                         {"fit", frame_fit_json(definition.fit, definition.pairs)}});
}

std::optional<FrameDefinition> frame_definition(const LocalFrame& frame) {
  try {  // the door of the JSON library: written by frame_definition_json
    const Json json = Json::parse(frame.definition.text);
    if (!json.contains("fit")) return std::nullopt;
    FrameDefinition out;
    out.origin = {json.at("origin").at("lat").get<double>(), json.at("origin").at("lon").get<double>(),
                  json.at("origin").at("h_m").get<double>()};
    out.fit = fit_of(json.at("fit"));
    return out;
  } catch (const Json::exception&) {
    return std::nullopt;
  }
}

Ordered frame_json(const LocalFrame& frame) {
  Ordered out{{"id", to_string(frame.id)}, {"name", frame.name}};
  out["site"] = frame.site ? Ordered(to_string(*frame.site)) : Ordered(nullptr);
  auto definition = Ordered::parse(frame.definition.text, nullptr, false);
  for (const char* key : {"origin", "fitted_at", "pairs", "fit"})
    out[key] = definition.is_object() && definition.contains(key) ? definition[key] : Ordered(nullptr);
  out["created_at"] = to_rfc3339(frame.created);
  return out;
}

FitRequest read_fit_request(const Json& body, std::vector<FieldError>& errors) {
  FitRequest out;
  Fields fields(body, "", errors);
  if (const auto parameters = fields.integer("parameters", 4, 7)) {
    if (*parameters != 4 && *parameters != 7) fields.error("parameters", "unknown_value", "must be 4 or 7");
    out.options.model = *parameters == 4 ? FrameModel::four : FrameModel::seven;
  }
  if (const auto free = fields.boolean("fit_scale")) out.options.fit_scale = *free;
  const Json* pairs = fields.child("pairs");
  if (pairs == nullptr || !pairs->is_array() || pairs->empty() || pairs->size() > 1000) {
    fields.error("pairs", "required", "must be an array of 1 to 1000 pairs");
    fields.finish();
    return out;
  }
  for (std::size_t i = 0; i < pairs->size(); ++i) {
    Fields inner((*pairs)[i], "/pairs/" + std::to_string(i), errors);
    PairRequest pair;
    pair.pair.name = inner.text("name", 80).value_or("");
    if (const auto at = inner.numbers("local_m", 3, -1e6, 1e6, true))
      pair.pair.local_m = {(*at)[0], (*at)[1], (*at)[2]};
    if (const auto sigma = inner.number("sigma_m", 1e-6, 1000)) pair.pair.sigma_m = *sigma;
    const bool globe = inner.has("lon") || inner.has("lat") || inner.has("h_m");
    if (const auto text = inner.text("anchor", 20)) {
      const auto id = parse_network_id(*text);
      if (!id)
        inner.error("anchor", "bad_id", id.error().message);
      else if (globe)
        inner.error("anchor", "twice", "give either coordinates or an anchor");
      else
        pair.anchor = id.value();
      if (pair.pair.name.empty()) pair.pair.name = *text;
    } else {
      const auto lon = inner.number("lon", -180, 180, true), lat = inner.number("lat", -90, 90, true),
                 height = inner.number("h_m", -500, 9000, true);
      if (lon && lat && height) pair.wgs84 = Wgs84{*lat, *lon, *height};
    }
    inner.finish();
    out.pairs.push_back(std::move(pair));
  }
  fields.finish();
  return out;
}

}  // namespace anchord::api
