#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "api/anchors/published_features.hpp"
#include "api/anchors/routes.hpp"
#include "api/exchange/flight_track.hpp"
#include "api/exchange/ogc_documents.hpp"
#include "api/exchange/ogc_query.hpp"
#include "api/exchange/ogc_zones.hpp"
#include "api/exchange/routes.hpp"
#include "api/kit/date_line.hpp"
#include "api/kit/or_null.hpp"
#include "api/kit/support.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/mission_store.hpp"
#include "core/ports/place_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

/// Absolute, since not every client resolves a relative link. The host is the one that the client asked,
/// which the server has judged; a proxy says whether it was by TLS.
std::string root_of(const Request& request) {
  const auto host = request.header("host");
  if (host.empty()) return "/ogc";
  const bool tls = request.header("x-forwarded-proto") == "https";
  return (tls ? "https://" : "http://") + std::string(host) + "/ogc";
}

/// A feature, its key in the order of pages, and when it is of.
struct Item {
  std::string key;
  Ordered feature;
  std::optional<Wgs84> at;
  std::optional<UtcTime> time;
  std::optional<LonLatBox> bounds{};  ///< of what is no point
};

bool is_in(const OgcBox& box, const Item& item) {
  if (item.bounds) return box.meets(*item.bounds);
  return item.at && box.holds(*item.at);
}

bool wanted(const Item& item, const OgcQuery& query) {
  if (query.box && !is_in(*query.box, item)) return false;
  return !query.interval || (item.time && query.interval->meets(*item.time, *item.time));
}

Item item_of(const AnchorFeature& feature, std::string key) {
  Item out{std::move(key), flat_feature_json(feature), {}, feature.calibrated};
  if (feature.estimate && feature.estimate->best) out.at = feature.estimate->best->wgs84;
  if (!out.feature.contains("id")) out.feature["id"] = to_string(feature.anchor.network_id);
  return out;
}

std::vector<Item> anchor_items(ExchangeApi& s, std::optional<std::uint64_t> revision, std::uint64_t& number) {
  std::vector<Item> out;
  for (const auto& feature : published_features(s.anchors, revision, number))
    out.push_back(item_of(feature, to_string(feature.anchor.network_id)));
  return out;
}

/// In order of anchors, the newest position of each first.
std::vector<Item> revision_items(ExchangeApi& s) {
  std::vector<Anchor> anchors;
  for (std::optional<AnchorId> after;;) {
    auto page = value_or_problem(s.anchors.anchors.anchors(1000, after));
    if (page.empty()) break;
    after = page.back().id;
    std::move(page.begin(), page.end(), std::back_inserter(anchors));
  }
  std::ranges::sort(anchors, {}, &Anchor::network_id);
  FeatureLookup lookup(s.anchors);
  std::vector<Item> out;
  for (const auto& anchor : anchors) {
    bool newest = true;
    for (const auto& position : value_or_problem(s.anchors.revisions.history(anchor.network_id))) {
      const auto feature = lookup.feature(anchor, position, position.since_revision, !newest);
      auto item =
          item_of(feature, std::to_string(position.since_revision) + '-' + to_string(anchor.network_id));
      item.feature["id"] = item.key;
      item.feature["properties"]["newest"] = std::exchange(newest, false);
      out.push_back(std::move(item));
    }
  }
  return out;
}

std::vector<Item> zone_items(ExchangeApi& s) {
  std::vector<Item> out;
  value_or_problem(each_zone(s.places, [&](const Floor& floor, const Building& building) {
    Item item{to_string(floor.id), zone_json(floor, building), {}, floor.created};
    item.bounds = bounds_of(item.feature);
    out.push_back(std::move(item));
  }));
  return out;
}

/// Of the collections that are made whole: all but tracks.
std::vector<Item> items_of(ExchangeApi& s, const OgcCollection& collection) {
  if (collection.id == "zones") return zone_items(s);
  if (collection.id == "revisions") return revision_items(s);
  std::uint64_t number = 0;
  return anchor_items(s, std::nullopt, number);
}

Ordered track_json(const Mission& mission, const FlightTrack& track) {
  Ordered line = Ordered::array();
  std::optional<double> before_deg;
  for (const auto& vertex : track.vertices) {
    before_deg = beside(vertex.at.lon_deg, before_deg.value_or(vertex.at.lon_deg));
    line.push_back({*before_deg, vertex.at.lat_deg, vertex.at.height_m});
  }
  Ordered out{{"type", "Feature"}, {"id", to_string(mission.id)}};
  out["geometry"] =
      line.size() > 1 ? Ordered{{"type", "LineString"}, {"coordinates", std::move(line)}} : Ordered(nullptr);
  out["properties"] = {
      {"name", mission.name},
      {"state", k_mission_state_words.word(mission.state)},
      {"kit", mission.kit},
      {"site", mission.site ? Ordered(to_string(*mission.site)) : Ordered(nullptr)},
      {"created_at", to_rfc3339(mission.created)},
      {"finished_at", mission.finished ? Ordered(to_rfc3339(*mission.finished)) : Ordered(nullptr)},
      {"n_fixes", track.n_fixes},
      {"spacing_m", track.spacing_m}};
  return out;
}

bool wanted(const Mission& mission, const FlightTrack& track, const OgcQuery& query) {
  if (query.interval) {
    const auto begin = track.vertices.empty() ? mission.created : track.vertices.front().time;
    const auto end = track.vertices.empty() ? mission.finished.value_or(begin) : track.vertices.back().time;
    if (!query.interval->meets(begin, end)) return false;
  }
  return !query.box ||
         std::ranges::any_of(track.vertices, [&](const auto& v) { return query.box->holds(v.at); });
}

Response answer(const Ordered& body, const OgcCrs& crs) {
  Response response = json_response(200, body, k_geojson);
  response.header("Content-Crs", '<' + std::string(crs.uri) + '>');
  return response;
}

void turn(Ordered& feature, const OgcCrs& crs) {
  if (feature["geometry"].is_object()) reorder(feature["geometry"]["coordinates"], crs);
}

/// The query of this request, with another cursor where one is given.
std::string query_text(const Request& request, const std::string& cursor) {
  std::string out;
  const auto add = [&out](std::string_view key, std::string_view value) {
    out += (out.empty() ? '?' : '&') + percent_encoded(key) + '=' + percent_encoded(value);
  };
  for (const auto& [key, value] : request.query) {
    if (key != "cursor" || cursor.empty()) add(key, value);
  }
  if (!cursor.empty()) add("cursor", cursor);
  return out;
}

struct Page {
  Ordered features = Ordered::array();
  std::string next;
  std::optional<std::size_t> matched{};
};

Response page_answer(const Request& request, const OgcCollection& collection, const OgcQuery& query,
                     Page page) {
  const std::string items = root_of(request) + "/collections/" + std::string(collection.id) + "/items";
  for (auto& feature : page.features) turn(feature, query.crs);
  Ordered links = Ordered::array();
  links.push_back(ogc_link(items + query_text(request, ""), "self", k_geojson, "This page"));
  if (!page.next.empty())
    links.push_back(ogc_link(items + query_text(request, page.next), "next", k_geojson, "The next page"));
  const auto n = page.features.size();
  Ordered body{{"type", "FeatureCollection"}, {"features", std::move(page.features)}, {"numberReturned", n}};
  if (page.matched) body["numberMatched"] = *page.matched;
  body["links"] = std::move(links);
  return answer(body, query.crs);
}

[[noreturn]] void refuse_cursor() {
  throw_problem(
      400, "malformed",
      "cursor was not issued by this server, or its page no longer exists: start again from the first "
      "page",
      {{"/cursor", "bad_cursor", "was not issued by this server"}});
}

/// Of a list that was made whole.
Page page_of(std::vector<Item> all, const OgcQuery& query) {
  std::erase_if(all, [&](const Item& item) { return !wanted(item, query); });
  Page page;
  page.matched = all.size();
  auto from = all.begin();
  if (!query.cursor.empty()) {
    from = std::ranges::find(all, query.cursor, &Item::key);
    if (from == all.end()) refuse_cursor();
  }
  for (; from != all.end(); ++from) {
    if (page.features.size() == query.limit) {
      page.next = from->key;
      break;
    }
    page.features.push_back(std::move(from->feature));
  }
  return page;
}

/// All pages of one revision, whatever is published between them.
Page anchor_page(ExchangeApi& s, OgcQuery query) {
  const auto cursor = revision_cursor(query.cursor);
  if (cursor.revision > newest_revision(s.anchors)) refuse_cursor();
  std::uint64_t number = 0;
  auto all = anchor_items(s, cursor.revision, number);
  query.cursor = cursor.after;
  Page page = page_of(std::move(all), query);
  if (!page.next.empty()) page.next = revision_cursor_text(page.next, number);
  return page;
}

/// Looks at no more flights than the page may hold, so that a filter costs no more than a page: one with few
/// features, or none, may have a next one.
Page track_page(ExchangeApi& s, const OgcQuery& query) {
  std::optional<MissionId> after;
  if (!query.cursor.empty()) {
    const auto id = parse_uuid(query.cursor);
    if (!id) refuse_cursor();
    after = MissionId{id.value()};
  }
  Page page;
  auto missions = value_or_problem(s.missions.missions(query.limit + 1, after));
  if (missions.size() > query.limit) {
    missions.pop_back();
    page.next = to_string(missions.back().id);
  }
  for (const auto& mission : missions) {
    const auto read = flight_track(s.measurements, mission.id);
    if (!read && read.error().code == Errc::not_found) continue;  // deleted since the list was read
    const auto track = value_or_problem(read);
    if (wanted(mission, track, query)) page.features.push_back(track_json(mission, track));
  }
  return page;
}

const OgcCollection& path_collection(const Request& request) {
  const auto* found = ogc_collection(request.params.at("collection"));
  if (found == nullptr)
    throw_problem(404, "not-found", "the collections are anchors, revisions, tracks and zones");
  return *found;
}

Response items(ExchangeApi& s, const Request& request) {
  const auto& collection = path_collection(request);
  const auto query =
      ogc_items_query(request, collection.usual_limit, collection.max_limit, collection.has_heights);
  if (collection.id == "tracks") return page_answer(request, collection, query, track_page(s, query));
  if (collection.id == "anchors") return page_answer(request, collection, query, anchor_page(s, query));
  return page_answer(request, collection, query, page_of(items_of(s, collection), query));
}

Response answer_one(const Request& request, const OgcCollection& collection, Ordered feature) {
  const auto crs = ogc_item_query(request, collection.has_heights);
  turn(feature, crs);
  const std::string home = root_of(request) + "/collections/" + std::string(collection.id);
  feature["links"] = {
      ogc_link(home + "/items/" + request.params.at("feature"), "self", k_geojson, "This feature"),
      ogc_link(home, "collection", "application/json", collection.title)};
  return answer(feature, crs);
}

Response one_of(const Request& request, const OgcCollection& collection, std::vector<Item> all) {
  const auto& wanted_id = request.params.at("feature");
  for (auto& item : all) {
    if (item.key == wanted_id || item.feature["id"] == wanted_id)
      return answer_one(request, collection, std::move(item.feature));
  }
  throw_problem(404, "not-found", "there is no such feature");
}

Response item(ExchangeApi& s, const Request& request) {
  const auto& collection = path_collection(request);
  if (collection.id != "tracks") return one_of(request, collection, items_of(s, collection));
  const auto mission = value_or_problem(s.missions.mission(path_id<MissionId>(request, "feature")));
  return answer_one(request, collection,
                    track_json(mission, value_or_problem(flight_track(s.measurements, mission.id))));
}

/// Widens it by a point or by the bounds of an outline, whose heights are not known.
void widen(std::optional<OgcBox>& box, const Item& item) {
  constexpr double k_any = std::numeric_limits<double>::infinity();
  OgcBox one{};
  if (item.bounds)
    one = {*item.bounds, -k_any, k_any};
  else if (item.at)
    one = {{item.at->lon_deg, item.at->lat_deg, item.at->lon_deg, item.at->lat_deg},
           item.at->height_m,
           item.at->height_m};
  else
    return;
  if (!box) box = one;
  box = OgcBox{{std::min(box->west, one.west), std::min(box->south, one.south), std::max(box->east, one.east),
                std::max(box->north, one.north)},
               std::min(box->low_m, one.low_m),
               std::max(box->high_m, one.high_m)};
}

/// Of anchors and floors, where they are few enough to look at; a reader zooms to it.
OgcExtent extent_of(ExchangeApi& s, const OgcCollection& collection) {
  OgcExtent out;
  if (collection.id == "tracks") return out;
  for (const auto& one : items_of(s, collection)) {
    widen(out.box, one);
    if (one.time) {
      if (!out.interval) out.interval = OgcInterval{one.time, one.time};
      out.interval->from = std::min(*out.interval->from, *one.time);
      out.interval->to = std::max(*out.interval->to, *one.time);
    }
  }
  return out;
}

Response collections(ExchangeApi& s, const Request& request) {
  ogc_document_query(request);
  const auto root = root_of(request);
  Ordered list = Ordered::array();
  for (const auto& one : k_ogc_collections) list.push_back(ogc_collection_json(root, one, extent_of(s, one)));
  return json_response(
      200,
      {{"links", Ordered::array({ogc_link(root + "/collections", "self", "application/json", "This list")})},
       {"collections", std::move(list)}});
}

Response collection(ExchangeApi& s, const Request& request) {
  ogc_document_query(request);
  const auto& one = path_collection(request);
  return json_response(200, ogc_collection_json(root_of(request), one, extent_of(s, one)));
}

}  // namespace

void add_ogc_routes(Router& router, ExchangeApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  router.add({Method::get, "/ogc", readers(), [](const Request& request) {
                ogc_document_query(request);
                return json_response(200, ogc_landing(root_of(request)));
              }});
  router.add({Method::get, "/ogc/conformance", readers(), [](const Request& request) {
                ogc_document_query(request);
                return json_response(200, ogc_conformance());
              }});
  router.add({Method::get, "/ogc/api", readers(), [](const Request& request) {
                ogc_document_query(request);
                return json_response(200, ogc_openapi(root_of(request)),
                                     "application/vnd.oai.openapi+json;version=3.0");
              }});
  router.add(as_heavy({Method::get, "/ogc/collections", readers(), on(collections)}));
  router.add(as_heavy({Method::get, "/ogc/collections/{collection}", readers(), on(collection)}));
  router.add(as_heavy({Method::get, "/ogc/collections/{collection}/items", readers(), on(items)}));
  router.add(as_heavy({Method::get, "/ogc/collections/{collection}/items/{feature}", readers(), on(item)}));
}

}  // namespace anchord::api
