#include <nlohmann/json.hpp>

#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/support.hpp"
#include "api/places/place_json.hpp"
#include "api/places/place_records.hpp"
#include "api/places/routes.hpp"
#include "api/places/structure_json.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/site_store.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

void read(const Json& body, Floor& floor, bool made) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (const auto name = fields.text("name", record_limits::k_name, made)) floor.name = *name;
  if (made) {
    if (const auto text = fields.text("building", 36, true)) {
      if (const auto id = parse_uuid(*text))
        floor.building = BuildingId{id.value()};
      else
        fields.error("building", "bad_id", id.error().message);
    }
  }
  if (const auto level =
          fields.number("level", record_limits::k_floor_level.min, record_limits::k_floor_level.max, made))
    floor.level = *level;
  if (const auto height = fields.number("base_height_m", record_limits::k_floor_base_m.min,
                                        record_limits::k_floor_base_m.max))
    floor.base_height_m = *height;
  else if (body.is_object() && body.contains("base_height_m") && body["base_height_m"].is_null())
    floor.base_height_m.reset();
  fields.finish();
  refuse_if_any(errors);
}

Response list_floors(PlaceApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields", "building"});
  const auto text = request.query_value("building");
  const auto building = cursor_id<BuildingId>(text.value_or(""));
  return id_page<FloorId>(
      request,
      [&](std::size_t limit, const std::optional<FloorId>& after) {
        return s.places.floors(limit, after, building);
      },
      [](const auto& floor) { return floor_json(floor); });
}

struct FloorRecord {
  using Place = Floor;
  static constexpr const char* k_path = "/api/v1/floors";
  static constexpr const char* k_word = "floor";
  static Response list(PlaceApi& s, const Request& request) { return list_floors(s, request); }
  static Place find(PlaceApi& s, const Request& request) { return path_floor(s, request); }
  static nlohmann::ordered_json json(const Place& place) { return floor_json(place); }
  static void read(const Json& body, Place& place, bool made) { api::read(body, place, made); }
};

Response walls(int status, const Floor& floor) {
  auto kept = kept_json(floor.structure.text);
  if (!kept.is_object()) kept = {{"outline", nullptr}, {"walls", Ordered::array()}};
  Response response = json_response(status, kept);
  response.header("ETag", etag(floor));
  return response;
}

/// The outline becomes the site's: the prior of the solver and what plans begin with.
void give_to_site(PlaceApi& s, const Request& request, const Floor& floor, const Document& outline) {
  if (!Access::any_of({Role::admin}).permits(request.principal))
    throw_problem(403, "forbidden", "site_outline changes the site: that needs the role admin");
  if (outline.empty())
    throw_problem(422, "validation", "there is no outline to copy to the site",
                  {{"/site_outline", "bad_value", "needs an outline"}});
  const auto building = value_or_problem(s.places.building(floor.building));
  Site site = value_or_problem(s.sites.site(building.site));
  std::string wrong;
  const auto rings = rings_of(kept_json(outline.text), wrong);
  if (!rings)
    throw_problem(422, "validation", "the outline cannot be used for the site",
                  {{"/outline" + wrong, "out_of_range", "a corner must be [lon, lat] in degrees"}});
  site.outline = *rings;
  value_or_problem(s.sites.update(site, site.version));
  s.audit(request, "site.change " + to_string(site.id) + " outline of floor " + to_string(floor.id));
}

Response put_walls(PlaceApi& s, const Request& request) {
  check_query(request, {});
  Floor floor = path_floor(s, request);
  require_match(request, etag(floor));
  const auto wanted = read_structure(json_body(request), floor.proposal);
  if (wanted.site_outline) give_to_site(s, request, floor, wanted.outline);
  floor.structure = wanted.structure;
  value_or_problem(s.places.update(floor, floor.version));
  ++floor.version;
  s.changed();
  s.audit(request, "floor.walls " + to_string(floor.id));
  return walls(200, floor);
}

}  // namespace

void add_floor_routes(Router& router, PlaceApi& s) {
  PlaceRecords<FloorRecord>::add_to(router, s);
  const std::string walls_of = "/api/v1/floors/{id}/walls";
  router.add({Method::get, walls_of, readers(), [&s](const Request& request) {
                check_query(request, {});
                return walls(200, path_floor(s, request));
              }});
  router.add({Method::put, walls_of, Access::any_of({Role::integrator}),
              [&s](const Request& request) { return put_walls(s, request); }, 4 << 20, false, true});
}

}  // namespace anchord::api
