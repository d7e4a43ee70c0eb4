#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

#include "api/anchors/anchor_answers.hpp"
#include "api/anchors/anchor_json.hpp"
#include "api/anchors/anchor_selection.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/published_features.hpp"
#include "api/anchors/routes.hpp"
#include "api/anchors/site_json.hpp"
#include "api/kit/content_tag.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/missions/mission_service.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

Response as_csv(const std::vector<AnchorFeature>& features) {
  Response response;
  response.header("Content-Type", "text/csv; charset=utf-8");
  response.body = anchors_csv_header() + "\r\n";
  for (const auto& feature : features) response.body += anchor_csv_row(feature) + "\r\n";
  return response;
}

Response list(AnchorApi& s, const Request& request) {
  const std::string format =
      negotiate(request, {"geojson", "json", "csv", "ndjson", "kml", "gpkg", "dxf", "ifc", "pnezd", "pozyx"});
  if (format != "geojson" && format != "json" && format != "csv" && format != "ndjson")
    return s.file(format, request);
  check_query(request, {"view", "revision", "mission", "site", "bbox", "limit", "cursor", "format"});
  const auto page = page_query(request);
  const auto [cursor, of_revision] = revision_cursor(page.cursor);
  Request asked = request;
  if (of_revision) asked.query["revision"] = std::to_string(*of_revision);
  std::uint64_t number = 0;
  auto all = selected_anchors(s, asked, number);
  if (!cursor.empty()) {
    const auto after = parse_network_id(cursor);
    if (!after)
      throw_problem(422, "validation", "cursor was not issued by this server",
                    {{"/cursor", "bad_cursor", "was not issued by this server"}});
    std::erase_if(all, [&](const auto& feature) { return feature.anchor.network_id <= after.value(); });
  }
  std::string next;
  if (all.size() > page.limit) {
    all.resize(page.limit);
    next = revision_cursor_text(to_string(all.back().anchor.network_id), number);
  }
  if (format == "csv") return as_csv(all);
  if (format == "ndjson") {
    Response response;
    response.header("Content-Type", "application/x-ndjson");
    for (const auto& feature : all) response.body += to_wire(anchor_feature_json(feature)) + '\n';
    return response;
  }
  Ordered features = Ordered::array();
  for (const auto& feature : all) features.push_back(anchor_feature_json(feature));
  Ordered body{{"type", "FeatureCollection"},
               {"features", std::move(features)},
               {"revision", number == 0 ? Ordered(nullptr) : Ordered(number)},
               {"next_cursor", next.empty() ? Ordered(nullptr) : Ordered(next)}};
  Response response = json_response(200, body, "application/geo+json");
  if (!next.empty()) response.header("Link", next_link(request, next));
  return response;
}

/// By UUID or by network id ("0x6a2f").
Anchor path_anchor(AnchorApi& s, const Request& request) {
  const auto& text = request.params.at("id");
  if (const auto id = parse_uuid(text)) return value_or_problem(s.anchors.anchor(AnchorId{id.value()}));
  const auto network_id = parse_network_id(text);
  if (!network_id) throw_problem(404, "not-found", "there is no anchor " + to_utf8(text, 60));
  return value_or_problem(s.anchors.anchor(network_id.value()));
}

AnchorFeature feature_of(AnchorApi& s, const Anchor& anchor) {
  if (auto published = published_feature(s, anchor)) return *std::move(published);
  FeatureLookup lookup(s);
  AnchorFeature feature;
  feature.anchor = anchor;
  feature.site = lookup.site(anchor.site);
  feature.status = anchor.retired ? "retired" : "found";
  return feature;
}

/// Of all that an answer shows: the anchor, its position, what contradicts that, its site (datum, base, map
/// system) and the frame of its positioning system.
std::string etag(const AnchorFeature& feature) {
  std::string tag =
      "\"a-" + std::to_string(feature.anchor.version) + '-' + std::to_string(feature.revision.value_or(0));
  if (feature.contradicted) tag += '-' + to_string(feature.contradicted->by);
  if (feature.site) tag += "-s" + std::to_string(feature.site->version);
  if (feature.local_m) {
    const auto* const bytes = reinterpret_cast<const char*>(feature.local_m->data());
    const auto local = content_tag({bytes, 3 * sizeof(double)}, "l");
    tag += '-' + local.substr(1, local.size() - 2);  // without its quotes
  }
  return tag + '"';
}

Response answer(const AnchorFeature& feature) {
  Response response = json_response(200, anchor_feature_json(feature), "application/geo+json");
  response.header("ETag", etag(feature));
  return response;
}

/// To a GET. Who names the ETag has the body already, which is not even made then; the router answers 304.
Response one(AnchorApi& s, const Request& request) {
  check_query(request, {});
  // Kept are the answers of those who see all sites: others may see no such anchor, or less of it.
  AnchorAnswers* const answers = current_sites().all() ? s.answers : nullptr;
  if (answers != nullptr) {
    if (auto kept = answers->find(request)) return *std::move(kept);
  }
  (void)s.contradictions.standing();  // settled, or there is no state that the answer could be kept under
  const auto before = answers != nullptr ? answers->state() : std::nullopt;
  const AnchorFeature feature = feature_of(s, path_anchor(s, request));
  const std::string tag = etag(feature);
  if (etag_listed(request.header("if-none-match"), tag)) {
    Response response;
    response.header("Content-Type", "application/geo+json");
    response.header("ETag", tag);
    return response;
  }
  Response response = answer(feature);
  if (answers != nullptr) answers->keep(request.params.at("id"), before, {response.body, tag});
  return response;
}

Response patch(AnchorApi& s, const Request& request) {
  Anchor anchor = path_anchor(s, request);
  require_match(request, etag(feature_of(s, anchor)));
  std::vector<FieldError> errors;
  patch_anchor(json_body(request), anchor, errors);
  if (anchor.site && !s.sites.site(*anchor.site))
    errors.push_back({"/site", "unknown_site", "there is no such site"});
  refuse_if_any(errors);
  value_or_problem(s.anchors.update(anchor, anchor.version));
  s.contradictions.changed();
  s.audit(request, "anchor.change " + to_string(anchor.network_id));
  return answer(feature_of(s, value_or_problem(s.anchors.anchor(anchor.id))));
}

Response estimates(AnchorApi& s, const Request& request) {
  check_query(request, {"mission"});
  const Anchor anchor = path_anchor(s, request);
  Ordered items = Ordered::array();
  for (const auto& view : s.missions.live(query_mission(request))) {
    for (const auto& estimate : view.estimates) {
      if (estimate.anchor == anchor.network_id)
        items.push_back(Ordered::parse(live_estimate_json(view.mission.id, estimate)));
    }
  }
  return list_response(request, std::move(items), "");
}

Response history(AnchorApi& s, const Request& request) {
  check_query(request, {});
  const Anchor anchor = path_anchor(s, request);
  Ordered items = Ordered::array();
  FeatureLookup lookup(s);
  for (const auto& position : value_or_problem(s.revisions.history(anchor.network_id)))
    items.push_back(published_json(position, lookup.globe(position)));
  return list_response(request, std::move(items), "");
}

Response export_geojson(AnchorApi& s, const Request& request) {
  check_query(request, {"flat", "revision", "site", "bbox"});
  const bool flat = query_flag(request, "flat");
  std::uint64_t number = 0;
  Ordered features = Ordered::array();
  for (const auto& feature : selected_anchors(s, request, number))
    features.push_back(flat ? flat_feature_json(feature) : anchor_feature_json(feature));
  Ordered body{{"type", "FeatureCollection"}, {"features", std::move(features)}};
  if (!flat) body["revision"] = number == 0 ? Ordered(nullptr) : Ordered(number);
  Response response = json_response(200, body, "application/geo+json");
  response.header("Content-Disposition", "attachment; filename=\"anchors.geojson\"");
  return response;
}

Response export_csv(AnchorApi& s, const Request& request) {
  check_query(request, {"revision", "site", "bbox"});
  std::uint64_t number = 0;
  Response response = as_csv(selected_anchors(s, request, number));
  response.header("Content-Disposition", "attachment; filename=\"anchors.csv\"");
  return response;
}

}  // namespace

void add_anchor_routes(Router& router, AnchorApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  Route listed{Method::get, "/api/v1/anchors", readers(), on(list)};
  // Running estimates of a mission that is not followed are computed, and files hold everything.
  listed.work_of = [](const Request& request) {
    const bool file = request.query_value("format").value_or("geojson") != "geojson";
    return file || request.query_value("view") == "live" ? Work::heavy : Work::ordinary;
  };
  router.add(std::move(listed));
  router.add({Method::get, std::string(k_anchor_pattern), readers(), on(one)});
  router.add({Method::patch, "/api/v1/anchors/{id}", Access::any_of({Role::integrator}), on(patch), 1 << 20,
              false, true});
  router.add(as_heavy({Method::get, "/api/v1/anchors/{id}/estimates", readers(), on(estimates)}));
  router.add({Method::get, "/api/v1/anchors/{id}/history", readers(), on(history)});
  router.add(as_heavy({Method::get, "/api/v1/exports/anchors.geojson", readers(), on(export_geojson)}));
  router.add(as_heavy({Method::get, "/api/v1/exports/anchors.csv", readers(), on(export_csv)}));
}

}  // namespace anchord::api
