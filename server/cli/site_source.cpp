#include "server/cli/site_source.hpp"

#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <vector>

#include "api/formats/floor_structure.hpp"
#include "server/cli/rest_json.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;

std::optional<double> number_of(const Json& object, const char* key) {
  const auto value = object.value(key, Json());
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

Result<void> add_building(RestClient& client, const Json& building, SiteStructure& out) {
  Building of;
  of.height_m = number_of(building, "height_m");
  BOOST_OUTCOME_TRY(const auto listed,
                    get_items(client, "/api/v1/floors?building=" + building.value("id", "")));
  std::vector<Floor> floors;
  for (const auto& floor : listed) {
    Floor& one = floors.emplace_back();
    one.level = number_of(floor, "level").value_or(0);
    one.base_height_m = number_of(floor, "base_height_m");
  }
  for (std::size_t i = 0; i < floors.size(); ++i) {
    BOOST_OUTCOME_TRY(const auto walls, client.get("/api/v1/floors/" + listed[i].value("id", "") + "/walls"));
    add_floor_structure(walls, storey_heights(floors[i], floors, of), out);
  }
  return boost::outcome_v2::success();
}

}  // namespace

Result<flight::Scene> fetch_site_scene(RestClient& client, const std::string& site) {
  BOOST_OUTCOME_TRY(const auto uuid, parse_uuid(site));
  const std::string id = to_string(uuid);
  BOOST_OUTCOME_TRY(const auto record, get_json(client, "/api/v1/sites/" + id));
  const auto origin = record.value("origin", Json());
  if (!origin.is_object() || !number_of(origin, "lat") || !number_of(origin, "lon"))
    return make_error(Errc::invalid_argument,
                      "site " + id + " has no origin: set one, or fly its first mission");
  SiteStructure structure;
  BOOST_OUTCOME_TRY(const auto buildings, get_items(client, "/api/v1/buildings?site=" + id));
  for (const auto& building : buildings) {
    BOOST_OUTCOME_TRYV(add_building(client, building, structure));
  }
  keep_longest(structure);
  std::map<NetworkId, Wgs84> published;
  BOOST_OUTCOME_TRY(const auto features, get_items(client, "/api/v1/anchors?site=" + id));
  for (const auto& feature : features) {
    const auto network_id = parse_network_id(feature.value("/properties/network_id"_json_pointer, ""));
    const auto at = feature.value("/geometry/coordinates"_json_pointer, Json());
    if (!network_id || !at.is_array() || at.size() != 3 || !at[0].is_number() || !at[1].is_number() ||
        !at[2].is_number())
      continue;
    published[network_id.value()] = {at[1].get<double>(), at[0].get<double>(), at[2].get<double>()};
  }
  return flight::site_scene(
      {*number_of(origin, "lat"), *number_of(origin, "lon"), number_of(origin, "h_m").value_or(0)}, structure,
      published);
}

}  // namespace anchord::cli
