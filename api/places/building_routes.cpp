#include <nlohmann/json.hpp>

#include "api/kit/id_page.hpp"
#include "api/kit/query_site.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/support.hpp"
#include "api/places/place_json.hpp"
#include "api/places/place_records.hpp"
#include "api/places/routes.hpp"
#include "core/ports/place_store.hpp"

namespace anchord::api {

using Json = nlohmann::json;

namespace {

Building path_building(PlaceApi& s, const Request& request) {
  return value_or_problem(s.places.building(path_id<BuildingId>(request)));
}

void read(const Json& body, Building& building, bool made) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (const auto name = fields.text("name", record_limits::k_name, made)) building.name = *name;
  if (const auto text = fields.text("site", 36, made)) {
    if (const auto id = parse_uuid(*text))
      building.site = SiteId{id.value()};
    else
      fields.error("site", "bad_id", id.error().message);
  }
  if (const auto height = fields.number("height_m", record_limits::k_building_height_m.min,
                                        record_limits::k_building_height_m.max))
    building.height_m = *height;
  else if (body.is_object() && body.contains("height_m") && body["height_m"].is_null())
    building.height_m.reset();
  fields.finish();
  refuse_if_any(errors);
}

Response list(PlaceApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "site"});
  const auto site = query_site(s.sites, request);
  return id_page<BuildingId>(
      request,
      [&](std::size_t limit, const std::optional<BuildingId>& after) {
        return s.places.buildings(limit, after, site);
      },
      [](const auto& building) { return building_json(building); });
}

struct BuildingRecord {
  using Place = Building;
  static constexpr const char* k_path = "/api/v1/buildings";
  static constexpr const char* k_word = "building";
  static Response list(PlaceApi& s, const Request& request) { return api::list(s, request); }
  static Place find(PlaceApi& s, const Request& request) { return path_building(s, request); }
  static nlohmann::ordered_json json(const Place& place) { return building_json(place); }
  static void read(const Json& body, Place& place, bool made) { api::read(body, place, made); }
};

}  // namespace

void add_building_routes(Router& router, PlaceApi& s) { PlaceRecords<BuildingRecord>::add_to(router, s); }

}  // namespace anchord::api
