#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/omlox/omlox_error.hpp"
#include "api/omlox/omlox_locations.hpp"
#include "api/omlox/omlox_zone.hpp"
#include "api/omlox/routes.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

constexpr std::string_view k_wgs84 = "EPSG:4326", k_local = "local";
constexpr std::array<std::string_view, 2> k_crs{k_local, k_wgs84};
constexpr double k_far_m = 1e6;  ///< no positioning system is so large

OmloxDialect dialect_of(const Request& request) {
  return query_word(request, "dialect", k_dialect_words).value_or(OmloxDialect::official);
}

/// The list at /zones, /providers or /trackables: ids, or in the other dialect objects.
Response ids_or_objects(const Request& request, Ordered objects) {
  if (dialect_of(request) == OmloxDialect::objects) return json_response(200, objects);
  Ordered ids = Ordered::array();
  for (const auto& one : objects) ids.push_back(one["id"]);
  return json_response(200, ids);
}

Ordered all_zones(OmloxApi& s, const Request& request) {
  const auto foreign = request.query_value("foreign_id");
  Ordered out = Ordered::array();
  for (const auto& zone : omlox_zones(s.anchors, s.places)) {
    if (!foreign || *foreign == zone.foreign_id) out.push_back(omlox_zone_json(zone, dialect_of(request)));
  }
  return out;
}

OmloxZone zone_of(OmloxApi& s, const Uuid& id) {
  for (auto& zone : omlox_zones(s.anchors, s.places)) {
    if (zone.id == id) return std::move(zone);
  }
  throw_problem(404, "not-found", "there is no zone " + to_string(id));
}

void need_frame(const OmloxZone& zone) {
  if (!zone.frame)
    throw_problem(
        422, "state",
        "zone " + zone.name + " has no fitted local frame: fit one with POST /api/v1/frames/{id}/fit");
}

struct Point {
  std::array<double, 3> at{};
  bool with_height{false};
};

/// A GeoJSON point of two or three numbers.
std::optional<Point> read_point(Fields& fields, const std::string& key, bool geographic,
                                std::vector<FieldError>& errors) {
  const Json* value = fields.child(key);
  if (value == nullptr) {
    fields.error(key, "required", key + " is missing");
    return std::nullopt;
  }
  Fields point(*value, fields.pointer(key), errors);
  static constexpr std::array<std::string_view, 1> k_types{"Point"};
  point.word("type", k_types, true);
  const Json* numbers = point.child("coordinates");
  point.finish();
  const std::array<double, 3> most =
      geographic ? std::array{180.0, 90.0, 1e5} : std::array{k_far_m, k_far_m, k_far_m};
  bool good = numbers != nullptr && numbers->is_array() && (numbers->size() == 2 || numbers->size() == 3);
  Point out;
  for (std::size_t i = 0; good && i < numbers->size(); ++i) {
    good = (*numbers)[i].is_number();
    if (!good) break;
    out.at[i] = (*numbers)[i].get<double>();
    good = std::abs(out.at[i]) <= most[i];
  }
  if (!good) {
    point.error("coordinates", "bad_value",
                geographic ? "must be longitude, latitude and optionally an ellipsoidal height in metres"
                           : "must be x, y and optionally z in metres of the zone, at most 1000 km");
    return std::nullopt;
  }
  out.with_height = numbers->size() == 3;
  return out;
}

/// From the zone's metres to the globe, or back; a point without height stays one.
Response transform(OmloxApi& s, const Request& request) {
  check_query(request, {"dialect", "geojson"});
  const auto zone = zone_of(s, path_uuid(request));
  const Json body = json_body(request);
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  const bool geographic = fields.word("crs", k_crs).value_or(std::string(k_local)) == k_wgs84;
  fields.text("source", 200);  // the zone is that of the path
  const auto point = read_point(fields, "position", geographic, errors);
  fields.finish();
  refuse_if_any(errors);
  need_frame(zone);
  Ordered out = Ordered::object();
  if (geographic) {
    const Wgs84 at{point->at[1], point->at[0],
                   point->with_height ? point->at[2] : zone.height_m.value_or(zone.frame->origin.height_m)};
    out["position"] = omlox_local_point(zone.local_from(at), point->with_height);
  } else {
    out["position"] =
        omlox_point(zone.wgs84_from({point->at[0], point->at[1], point->at[2]}), point->with_height);
  }
  out["source"] = to_string(zone.id);
  out["crs"] = geographic ? k_local : k_wgs84;
  return json_response(200, query_flag(request, "geojson") ? omlox_feature(std::move(out)) : out);
}

/// How locations are asked for: in which numbers, and in which form.
struct LocationForm {
  std::optional<OmloxZone> local{};
  bool geojson{false};
};

LocationForm location_form(OmloxApi& s, const Request& request) {
  check_query(request, {"crs", "zone_id", "geojson", "dialect"});
  LocationForm out;
  out.geojson = query_flag(request, "geojson");
  const auto crs = request.query_value("crs").value_or(std::string(k_wgs84));
  if (std::ranges::find(k_crs, crs) == k_crs.end()) refuse_query_word("crs", k_crs);
  if (crs == k_wgs84) return out;
  const auto id = parse_uuid(request.query_value("zone_id").value_or(""));
  if (!id)
    throw_problem(422, "validation", "local metres need a zone",
                  {{"/zone_id", "required", "must be the id of a zone with crs=local"}});
  out.local = zone_of(s, id.value());
  need_frame(*out.local);
  return out;
}

Ordered in_form(OmloxApi& s, const OmloxLocation& location, const LocationForm& form) {
  Ordered out = omlox_location_json(location, s.clock.now(), form.local ? &*form.local : nullptr);
  return form.geojson ? omlox_feature(std::move(out)) : out;
}

Response answer_locations(OmloxApi& s, const std::vector<OmloxLocation>& locations,
                          const LocationForm& form) {
  Ordered out = Ordered::array();
  for (const auto& one : locations) out.push_back(in_form(s, one, form));
  if (!form.geojson) return json_response(200, out);
  Ordered collection{{"type", "FeatureCollection"}};
  collection["features"] = std::move(out);
  return json_response(200, collection, "application/geo+json");
}

Ordered all_providers(OmloxApi& s) {
  Ordered out = Ordered::array();
  for (const auto& one : s.locations.providers()) out.push_back(omlox_provider_json(one));
  return out;
}

Response one_of(const Request& request, const Ordered& all, std::string_view what) {
  const auto& id = request.params.at("id");
  for (const auto& one : all) {
    if (one["id"] == id) return json_response(200, one);
  }
  throw_problem(404, "not-found", "there is no " + std::string(what) + ' ' + id);
}

Response provider_location(OmloxApi& s, const Request& request) {
  const auto form = location_form(s, request);
  const auto& id = request.params.at("id");
  for (const auto& one : s.locations.newest()) {
    if (one.provider.id == id) return json_response(200, in_form(s, one, form));
  }
  throw_problem(404, "not-found", "provider " + id + " has not been seen since the server started");
}

std::vector<OmloxLocation> of_trackable(OmloxApi& s, const Request& request) {
  const Uuid id = path_uuid(request);
  const auto providers = s.locations.providers();
  if (std::ranges::find(providers, id, &OmloxProvider::trackable) == providers.end())
    throw_problem(404, "not-found", "there is no trackable " + to_string(id));
  auto all = s.locations.newest();
  std::erase_if(all, [&](const OmloxLocation& one) { return one.provider.trackable != id; });
  return all;
}

Response trackable_location(OmloxApi& s, const Request& request) {
  const auto form = location_form(s, request);
  const auto all = of_trackable(s, request);
  const auto newest = std::ranges::max_element(all, {}, &OmloxLocation::time);
  if (newest == all.end()) throw_problem(404, "not-found", "it has not been seen since the server started");
  return json_response(200, in_form(s, *newest, form));
}

void add_zone_routes(Router& router, OmloxApi& s) {
  router.add(as_heavy({Method::get, "/omlox/v2/zones", readers(), [&s](const Request& request) {
                         check_query(request, {"foreign_id", "dialect"});
                         return ids_or_objects(request, all_zones(s, request));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/zones/summary", readers(), [&s](const Request& request) {
                         check_query(request, {"foreign_id", "dialect"});
                         return json_response(200, all_zones(s, request));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/zones/{id}", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return json_response(
                             200, omlox_zone_json(zone_of(s, path_uuid(request)), dialect_of(request)));
                       }}));
  router.add(as_heavy({Method::put, "/omlox/v2/zones/{id}/transform", readers(),
                       [&s](const Request& request) { return transform(s, request); }}));
}

void add_provider_routes(Router& router, OmloxApi& s) {
  router.add(as_heavy({Method::get, "/omlox/v2/providers", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return ids_or_objects(request, all_providers(s));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/providers/summary", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return json_response(200, all_providers(s));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/providers/locations", readers(), [&s](const Request& request) {
                         const auto form = location_form(s, request);
                         return answer_locations(s, s.locations.newest(), form);
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/providers/{id}", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return one_of(request, all_providers(s), "provider");
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/providers/{id}/location", readers(),
                       [&s](const Request& request) { return provider_location(s, request); }}));
}

void add_trackable_routes(Router& router, OmloxApi& s) {
  router.add(as_heavy({Method::get, "/omlox/v2/trackables", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return ids_or_objects(request, omlox_trackables(s.locations.providers()));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/trackables/summary", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return json_response(200, omlox_trackables(s.locations.providers()));
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/trackables/{id}", readers(), [&s](const Request& request) {
                         check_query(request, {"dialect"});
                         return one_of(request, omlox_trackables(s.locations.providers()), "trackable");
                       }}));
  router.add(as_heavy({Method::get, "/omlox/v2/trackables/{id}/location", readers(),
                       [&s](const Request& request) { return trackable_location(s, request); }}));
  router.add(
      as_heavy({Method::get, "/omlox/v2/trackables/{id}/locations", readers(), [&s](const Request& request) {
                  const auto form = location_form(s, request);
                  return answer_locations(s, of_trackable(s, request), form);
                }}));
}

}  // namespace

void add_omlox_routes(Router& router, OmloxApi& s) {
  router.refusals_under(std::string(k_omlox_root), as_omlox_error);
  add_zone_routes(router, s);
  add_provider_routes(router, s);
  add_trackable_routes(router, s);
  router.add({Method::get, "/omlox/v2/ws/socket", readers(), [](const Request&) -> Response {
                Response response = problem(426, "method", "this is a WebSocket: ask for an upgrade");
                response.header("Upgrade", "websocket");
                return response;
              }});
}

}  // namespace anchord::api
