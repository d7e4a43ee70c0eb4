#include "api/exchange/anchor_tables.hpp"

#include <cmath>
#include <numbers>
#include <set>

#include "api/exchange/flight_track.hpp"
#include "api/kit/date_line.hpp"
#include "api/kit/problem.hpp"
#include "core/geo/enu.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {
namespace {

using Type = FeatureTable::Type;
using Value = FeatureTable::Value;

Eigen::Vector3d vertex(const Wgs84& at) { return {at.lon_deg, at.lat_deg, at.height_m}; }
void keep_together(std::vector<Eigen::Vector3d>& vertices) {
  for (std::size_t i = 1; i < vertices.size(); ++i)
    vertices[i].x() = beside(vertices[i].x(), vertices[i - 1].x());
}
Value text(const std::string& value) { return value.empty() ? Value{} : Value{value}; }
template <class T>
Value known(const std::optional<T>& value) {
  return value ? Value{*value} : Value{};
}
Value real(bool there, double value) { return there ? Value{value} : Value{}; }

/// One symbol of QGIS, plain enough for every version since 3.0.
std::string qml(const char* kind, const char* layer, const std::string& properties, const char* label) {
  std::string out =
      "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'><qgis version=\"3.22\"><renderer-v2 "
      "type=\"singleSymbol\" symbollevels=\"0\" enableorderby=\"0\" forceraster=\"0\"><symbols><symbol "
      "name=\"0\" type=\"";
  out += std::string(kind) + "\" alpha=\"1\" force_rhr=\"0\" clip_to_extent=\"1\"><layer class=\"" + layer +
         "\" enabled=\"1\" locked=\"0\" pass=\"0\"><Option type=\"Map\">" + properties +
         "</Option></layer></symbol></symbols></renderer-v2>";
  if (label != nullptr) {
    out += std::string("<labeling type=\"simple\"><settings><text-style fieldName=\"") + label +
           "\" fontSize=\"9\" fontSizeUnit=\"Point\" textColor=\"20,20,20,255\" "
           "textOpacity=\"1\"/><placement placement=\"6\" "
           "dist=\"1\" distUnits=\"MM\"/></settings></labeling>";
  }
  return out + "</qgis>";
}
std::string option(const char* name, const char* value) {
  return std::string("<Option type=\"QString\" name=\"") + name + "\" value=\"" + value + "\"/>";
}

FeatureTable anchors_table(std::span<const AnchorFeature> anchors) {
  FeatureTable out{.name = "anchors",
                   .title = "UWB anchors",
                   .description = "Published anchors; sigma and covariance are 1-sigma in east, north, up",
                   .geometry = FeatureTable::Geometry::point,
                   .columns = {{"network_id"},
                               {"name"},
                               {"status"},
                               {"revision", Type::integer},
                               {"calibrated_at", Type::time},
                               {"site"},
                               {"building"},
                               {"floor"},
                               {"space"},
                               {"asset_tag"},
                               {"ifc_guid"},
                               {"verdict"},
                               {"acceptable", Type::boolean},
                               {"contradiction"},
                               {"override_reason"}},
                   .rows = {},
                   .qml = qml("marker", "SimpleMarker",
                              option("name", "triangle") + option("color", "0,110,160,255") +
                                  option("outline_color", "255,255,255,255") + option("size", "3.5"),
                              "network_id")};
  for (const char* name : {"h_ellipsoidal_m", "height_orthometric_m", "e_m", "n_m", "local_x_m", "local_y_m",
                           "local_z_m", "cov_ee_m2", "cov_en_m2", "cov_eu_m2", "cov_nn_m2", "cov_nu_m2",
                           "cov_uu_m2", "h95_m", "v95_m", "epoch"})
    out.columns.push_back({name, Type::real});
  out.columns.push_back({"epsg", Type::integer});
  out.columns.push_back({"geoid"});
  out.columns.push_back({"frame"});
  for (const auto& f : anchors) {
    const Anchor& a = f.anchor;
    const bool placed = f.estimate && f.estimate->best;
    const auto place = map_accuracy(f);
    const bool spread = place && place->covariance_m2.allFinite();
    const Eigen::Matrix3d c = spread ? place->covariance_m2 : Eigen::Matrix3d::Zero();
    const bool globe = placed && f.estimate->best->wgs84;
    const Eigen::Vector3d local = f.local_m.value_or(Eigen::Vector3d::Zero());
    FeatureTable::Row row;
    if (globe) row.vertices = {vertex(*f.estimate->best->wgs84)};
    row.values = {to_string(a.network_id),
                  text(a.name),
                  f.status,
                  f.revision ? Value{static_cast<std::int64_t>(*f.revision)} : Value{},
                  f.calibrated ? Value{to_rfc3339(*f.calibrated)} : Value{},
                  a.site ? Value{to_string(*a.site)} : Value{},
                  text(a.building),
                  text(a.floor),
                  text(a.space),
                  text(a.asset_tag),
                  text(a.ifc_guid),
                  f.estimate ? Value{std::string(k_verdict_words.word(f.estimate->verdict))} : Value{},
                  f.estimate ? Value{f.estimate->acceptable()} : Value{},
                  f.contradicted ? Value{f.contradicted->text} : Value{},
                  f.overridden ? Value{f.overridden->reason} : Value{},
                  real(globe, globe ? f.estimate->best->wgs84->height_m : 0),
                  known(f.height_orthometric_m),
                  real(f.projected.has_value(), f.projected ? f.projected->e_m : 0),
                  real(f.projected.has_value(), f.projected ? f.projected->n_m : 0)};
    for (int i = 0; i < 3; ++i) row.values.push_back(real(f.local_m.has_value(), local[i]));
    for (const auto& [i, j] : {std::pair{0, 0}, {0, 1}, {0, 2}, {1, 1}, {1, 2}, {2, 2}})
      row.values.push_back(real(spread, c(i, j)));
    row.values.push_back(real(spread, place ? place->h95_m : 0));
    row.values.push_back(real(spread, place ? place->v95_m : 0));
    row.values.push_back(f.site ? known(f.site->crs_epoch) : Value{});
    row.values.push_back(f.projected ? Value{std::int64_t{f.projected->epsg}} : Value{});
    row.values.push_back(f.height_orthometric_m ? text(f.geoid) : Value{});
    row.values.push_back(f.site ? text(f.site->crs_frame) : Value{});
    out.rows.push_back(std::move(row));
  }
  return out;
}

FeatureTable ellipses_table(std::span<const AnchorFeature> anchors) {
  FeatureTable out{.name = "ellipses95",
                   .title = "95 % ellipses",
                   .description = "Horizontal area that contains the anchor with 95 % probability",
                   .geometry = FeatureTable::Geometry::polygon,
                   .columns = {{"network_id"},
                               {"major_m", Type::real},
                               {"minor_m", Type::real},
                               {"azimuth_deg", Type::real}},
                   .rows = {},
                   .qml = qml("fill", "SimpleFill",
                              option("color", "0,110,160,40") + option("outline_color", "0,110,160,255") +
                                  option("outline_width", "0.3"),
                              nullptr)};
  constexpr int k_corners = 72;  // 5 degrees: the polygon is 0.1 % inside the ellipse
  for (const auto& f : anchors) {
    const auto place = map_accuracy(f);
    if (!place || !place->covariance_m2.allFinite() || !f.estimate->best->wgs84) continue;
    const auto ellipse = error_ellipse(place->covariance_m2);
    const EnuFrame here(*f.estimate->best->wgs84);
    const double azimuth = ellipse.azimuth_deg * std::numbers::pi / 180;
    FeatureTable::Row row;
    for (int k = 0; k < k_corners; ++k) {
      const double t = 2 * std::numbers::pi * k / k_corners;  // from the end of the major axis, to the left
      const double along = ellipse.major_m * std::cos(t), left = ellipse.minor_m * std::sin(t);
      const Enu at{{along * std::sin(azimuth) - left * std::cos(azimuth),
                    along * std::cos(azimuth) + left * std::sin(azimuth), 0}};
      row.vertices.push_back(vertex(here.wgs84_from_enu(at)));
    }
    row.vertices.push_back(row.vertices.front());
    keep_together(row.vertices);
    row.values = {to_string(f.anchor.network_id), ellipse.major_m, ellipse.minor_m, ellipse.azimuth_deg};
    out.rows.push_back(std::move(row));
  }
  return out;
}

FeatureTable tracks_table(std::span<const AnchorFeature> anchors, MissionStore& missions,
                          MeasurementStore& measurements) {
  FeatureTable out{.name = "tracks",
                   .title = "Flight paths",
                   .description = "Flights that the anchors were calibrated from",
                   .geometry = FeatureTable::Geometry::line,
                   .columns = {{"mission"},
                               {"name"},
                               {"created_at", Type::time},
                               {"n_fixes", Type::integer},
                               {"spacing_m", Type::real}},
                   .rows = {},
                   .qml = qml("line", "SimpleLine",
                              option("line_color", "200,120,0,255") + option("line_width", "0.4"), nullptr)};
  std::set<MissionId> flown;
  for (const auto& f : anchors) flown.insert(f.missions.begin(), f.missions.end());
  for (const auto& id : flown) {
    const auto mission = missions.mission(id);
    if (!mission && mission.error().code == Errc::not_found) continue;  // deleted since
    const auto of_mission = value_or_problem(mission);
    const auto read = flight_track(measurements, id);
    if (!read && read.error().code == Errc::not_found) continue;
    const auto track = value_or_problem(read);
    FeatureTable::Row row;
    if (track.vertices.size() > 1) {
      for (const auto& one : track.vertices) row.vertices.push_back(vertex(one.at));
      keep_together(row.vertices);
    }
    row.values = {to_string(id), text(of_mission.name), to_rfc3339(of_mission.created),
                  static_cast<std::int64_t>(track.n_fixes), track.spacing_m};
    out.rows.push_back(std::move(row));
  }
  return out;
}

}  // namespace

std::vector<FeatureTable> anchor_tables(std::span<const AnchorFeature> anchors, MissionStore& missions,
                                        MeasurementStore& measurements) {
  // Lowest first, as a map is drawn.
  return {tracks_table(anchors, missions, measurements), ellipses_table(anchors), anchors_table(anchors)};
}

}  // namespace anchord::api
