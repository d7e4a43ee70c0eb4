#include "api/places/georeference.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/projection.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;
using floor_plan::FitModel;
using floor_plan::GeoTags;
using floor_plan::PixelPair;

namespace {

constexpr std::size_t k_max_points = 100;

Ordered pair_json(const Eigen::Vector2d& v) { return {v.x(), v.y()}; }

Ordered head_json(std::string_view source, std::string_view model, const Wgs84& origin,
                  const floor_plan::PlanTransform& t) {
  const auto& m = t.linear;
  return {{"source", source},
          {"model", model},
          {"origin", {{"lon", origin.lon_deg}, {"lat", origin.lat_deg}, {"h_m", origin.height_m}}},
          {"enu_from_pixel", {m(0, 0), m(0, 1), t.shift_m.x(), m(1, 0), m(1, 1), t.shift_m.y()}},
          {"scale_m_per_px", t.scale_m_per_px()},
          {"turn_deg", t.turn_deg()}};
}

/// One clicked point, its place in degrees or in metres of the site.
struct Click {
  PixelPair pair;
  std::optional<Wgs84> at{};
};

Click read_click(const Json& body, const std::string& where, std::int64_t width_px, std::int64_t height_px,
                 std::vector<FieldError>& errors) {
  Fields fields(body, where, errors);
  Click click;
  click.pair.name = fields.text("name", 100).value_or("");
  if (const auto pixel =
          fields.numbers("pixel", 2, 0, static_cast<double>(std::max(width_px, height_px)), true))
    click.pair.pixel = {(*pixel)[0], (*pixel)[1]};
  const auto lon = fields.number("lon", -180, 180), lat = fields.number("lat", -90, 90);
  const auto enu = fields.numbers("enu_m", 2, -1e6, 1e6);
  if (lon && lat && !enu)
    click.at = Wgs84{*lat, *lon, 0};
  else if (enu && !lon && !lat)
    click.pair.enu_m = {(*enu)[0], (*enu)[1]};
  else if (fields.is_object())
    fields.error("lon", "required", "a point needs either lon and lat, or enu_m");
  fields.finish();
  return click;
}

std::optional<double> read_known_scale(Fields& fields, std::vector<FieldError>& errors) {
  const Json* known = fields.child("known_length");
  if (known == nullptr) return std::nullopt;
  Fields inner(*known, "/known_length", errors);
  const auto from = inner.numbers("from_px", 2, -1e6, 1e6, true),
             to = inner.numbers("to_px", 2, -1e6, 1e6, true);
  const auto length = inner.number("length_m", 0.1, 10'000, true);
  inner.finish();
  if (!from || !to || !length) return std::nullopt;
  const double px = std::hypot((*from)[0] - (*to)[0], (*from)[1] - (*to)[1]);
  if (px < 5) {
    errors.push_back({"/known_length", "out_of_range", "the two ends are less than 5 pixels apart"});
    return std::nullopt;
  }
  return *length / px;
}

Georeference by_points(const Json& points, Fields& fields, std::int64_t width_px, std::int64_t height_px,
                       const std::optional<Wgs84>& site_origin, std::vector<FieldError>& errors) {
  floor_plan::PlanFitOptions options;
  options.model = fields.word("model", floor_plan::k_fit_model_words).value_or(FitModel::helmert);
  options.known_scale_m_per_px = read_known_scale(fields, errors);
  std::vector<Click> clicks;
  if (!points.is_array() || points.size() > k_max_points) {
    fields.error("points", "wrong_type",
                 "must be an array of at most " + std::to_string(k_max_points) + " points");
  } else {
    for (std::size_t i = 0; i < points.size(); ++i)
      clicks.push_back(read_click(points[i], "/points/" + std::to_string(i), width_px, height_px, errors));
  }
  fields.finish();
  refuse_if_any(errors);
  Georeference out;
  std::optional<Wgs84> origin = site_origin;
  for (const auto& click : clicks) {
    if (origin) break;
    origin = click.at;
  }
  if (!origin)
    throw_problem(422, "validation",
                  "the site has no origin: give the points in degrees, or set an origin for the site",
                  {{"/points", "bad_value", "enu_m needs a site with an origin"}});
  out.origin = *origin;
  const EnuFrame frame(out.origin);
  std::vector<PixelPair> pairs;
  for (const auto& click : clicks) {
    pairs.push_back(click.pair);
    if (click.at)
      pairs.back().enu_m =
          frame.enu_from_wgs84({click.at->lat_deg, click.at->lon_deg, out.origin.height_m}).m.head<2>();
  }
  const auto fit = floor_plan::fit_plan(pairs, options);
  if (!fit)
    throw_problem(422, "validation", fit.error().message, {{"/points", "bad_value", fit.error().message}});
  const auto& f = fit.value();
  out.transform = f.transform;
  Ordered kept = head_json("points", floor_plan::k_fit_model_words.word(f.model), out.origin, f.transform);
  kept["rms_m"] = f.rms_m;
  kept["redundancy"] = f.redundancy;
  kept["points"] = Ordered::array();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto& left_out = f.residuals[i].left_out_m;
    kept["points"].push_back({{"name", pairs[i].name},
                              {"pixel", pair_json(pairs[i].pixel)},
                              {"enu_m", pair_json(pairs[i].enu_m)},
                              {"residual_m", pair_json(f.residuals[i].residual_m)},
                              {"left_out_m", left_out ? pair_json(*left_out) : Ordered(nullptr)}});
  }
  kept["wrong"] = f.wrong ? Ordered(*f.wrong) : Ordered(nullptr);
  kept["notes"] = f.notes;
  out.document = {to_wire(kept)};
  if (f.wrong) out.wrong = f.notes.front();
  return out;
}

/// Six lines of a world file, for the middle of the first pixel: x per column, y per column, x per row, y per
/// row, x, y.
std::optional<GeoTags> read_world_file(Fields& fields) {
  const auto six = fields.numbers("world_file", 6, -1e9, 1e9, true);
  const auto epsg = fields.integer("epsg", 1024, 32766, true);
  if (!six || !epsg) return std::nullopt;
  const auto& w = *six;
  GeoTags tags;
  tags.epsg = static_cast<int>(*epsg);
  tags.geographic = tags.epsg == 4326 || tags.epsg == 4258;
  auto& m = tags.map_from_pixel;
  m << w[0], w[2], w[4], w[1], w[3], w[5];
  m.col(2) -= 0.5 * (m.col(0) + m.col(1));
  if (m.leftCols<2>().determinant() == 0) {
    fields.error("world_file", "out_of_range", "its rows and columns have no area");
    return std::nullopt;
  }
  return tags;
}

}  // namespace

Result<Projection> map_of(int epsg, const SiteDatum& datum) {
  if (const auto known = geographic_epsg(datum.frame))
    return Projection::open(epsg, *known, datum.epoch_year);
  return Projection::open_own(epsg);
}

Result<Georeference> by_map(const GeoTags& tags, std::string_view source, std::int64_t width_px,
                            std::int64_t height_px, const std::optional<Wgs84>& site_origin,
                            const SiteDatum& datum) {
  std::optional<Projection> projection;
  if (!tags.geographic) {
    BOOST_OUTCOME_TRY(auto opened, map_of(tags.epsg, datum));
    projection.emplace(std::move(opened));
  }
  const auto on_globe = [&](const Eigen::Vector2d& pixel) -> Result<Wgs84> {
    const Eigen::Vector2d map = tags.map_from_pixel * Eigen::Vector3d(pixel.x(), pixel.y(), 1);
    if (projection) return projection->geographic(map, 0);
    if (std::abs(map.x()) > 180 || std::abs(map.y()) > 90)
      return make_error(
          Errc::invalid_argument,
          "with the map file the plan has no valid position on the globe: check its unit and EPSG code");
    return Wgs84{map.y(), map.x(), 0};
  };
  const double w = static_cast<double>(width_px), h = static_cast<double>(height_px);
  Georeference out;
  BOOST_OUTCOME_TRY(const auto middle, on_globe({w / 2, h / 2}));
  out.origin = site_origin.value_or(middle);
  const EnuFrame frame(out.origin);
  // Over a plan the map is an affine of the ground to a millimetre: nine points show how well,
  // of a tiny picture far enough apart to be fitted.
  std::vector<PixelPair> pairs;
  for (const double x : {0.0, w / 2, std::max(w, 100.0)})
    for (const double y : {0.0, h / 2, std::max(h, 100.0)}) {
      BOOST_OUTCOME_TRY(const auto at, on_globe({x, y}));
      pairs.push_back(
          {"", {x, y}, frame.enu_from_wgs84({at.lat_deg, at.lon_deg, out.origin.height_m}).m.head<2>()});
    }
  BOOST_OUTCOME_TRY(const auto fit, floor_plan::fit_plan(pairs, {.model = FitModel::affine}));
  if (site_origin && fit.transform.enu_from({w / 2, h / 2}).norm() > 50'000)
    return make_error(Errc::invalid_argument,
                      "with the map file the plan is more than 50 km from its site: check its EPSG code");
  out.transform = fit.transform;
  Ordered kept = head_json(source, "affine", out.origin, fit.transform);
  kept["epsg"] = tags.epsg;
  kept["rms_m"] = fit.rms_m;
  kept["notes"] = Ordered::array();
  out.document = {to_wire(kept)};
  return out;
}

Georeference read_georeference(const Json& body, const std::optional<GeoTags>& tags, std::int64_t width_px,
                               std::int64_t height_px, const std::optional<Wgs84>& site_origin,
                               const SiteDatum& datum) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (const Json* points = fields.child("points"))
    return by_points(*points, fields, width_px, height_px, site_origin, errors);
  std::optional<GeoTags> map = tags;
  std::string_view source = "geotiff";
  if (fields.has("world_file")) {
    map = read_world_file(fields);
    source = "world_file";
  } else if (!fields.boolean("geotiff").value_or(false)) {
    fields.error("points", "required", "give points, a world_file with its epsg, or geotiff: true");
  } else if (!tags) {
    fields.error("geotiff", "bad_value", "the plan has no GeoTIFF tags with an EPSG code: click points");
  }
  fields.finish();
  refuse_if_any(errors);
  return value_or_problem(by_map(*map, source, width_px, height_px, site_origin, datum));
}

std::optional<Georeference> kept_georeference(const Document& document) {
  const auto j = kept_json(document.text);
  if (!j.is_object() || !j.contains("enu_from_pixel") || !j.contains("origin")) return std::nullopt;
  const auto& m = j["enu_from_pixel"];
  Georeference out;
  out.origin = {j["origin"]["lat"].get<double>(), j["origin"]["lon"].get<double>(),
                j["origin"]["h_m"].get<double>()};
  out.transform.linear << m[0].get<double>(), m[1].get<double>(), m[3].get<double>(), m[4].get<double>();
  out.transform.shift_m = {m[2].get<double>(), m[5].get<double>()};
  out.document = document;
  return out;
}

}  // namespace anchord::api
