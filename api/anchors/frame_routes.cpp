#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "api/anchors/frame_json.hpp"
#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/id_page.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/support.hpp"
#include "core/geo/enu.hpp"
#include "core/geo/source_crs.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

namespace {

std::string etag(const LocalFrame& frame) { return "\"f-" + std::to_string(frame.version) + '"'; }

Response answer(int status, const LocalFrame& frame) {
  Response response = json_response(status, frame_json(frame));
  response.header("ETag", etag(frame));
  return response;
}

/// By UUID or by name.
LocalFrame find(AnchorApi& s, const std::string& text) {
  if (const auto id = parse_uuid(text)) return value_or_problem(s.frames.frame(FrameId{id.value()}));
  return value_or_problem(s.frames.frame(text));
}

void read_fields(const nlohmann::json& body, bool whole, LocalFrame& frame) {
  std::vector<FieldError> errors;
  Fields fields(body, "", errors);
  if (const auto name = fields.text("name", record_limits::k_frame_name, whole)) {
    frame.name = *name;
    if (name->empty()) fields.error("name", "required", "a frame needs a name");
  }
  if (const auto text = fields.text("site", 36)) {
    const auto id = parse_uuid(*text);
    if (id)
      frame.site = SiteId{id.value()};
    else
      fields.error("site", "bad_id", id.error().message);
  }
  fields.finish();
  refuse_if_any(errors);
}

Response list_frames(AnchorApi& s, const Request& request) {
  check_query(request, {"limit", "cursor", "fields"});
  return id_page<FrameId>(
      request,
      [&](std::size_t limit, const std::optional<FrameId>& after) { return s.frames.frames(limit, after); },
      [&](const auto& frame) { return frame_json(frame); });
}

Response create_frame(AnchorApi& s, const Request& request) {
  LocalFrame frame;
  read_fields(json_body(request), true, frame);
  frame.site = named_or_own(frame.site);
  frame.created = s.clock.now();
  frame.id.uuid = make_uuid_v7(frame.created);
  value_or_problem(s.frames.insert(frame));
  s.audit(request, "frame.create " + frame.name);
  Response response = answer(201, frame);
  response.header("Location", "/api/v1/frames/" + to_string(frame.id));
  return response;
}

Response patch_frame(AnchorApi& s, const Request& request) {
  LocalFrame frame = find(s, request.params.at("id"));
  require_match(request, etag(frame));
  read_fields(json_body(request), false, frame);
  value_or_problem(s.frames.update(frame, frame.version));
  ++frame.version;
  s.audit(request, "frame.change " + frame.name);
  return answer(200, frame);
}

Response remove_frame(AnchorApi& s, const Request& request) {
  const LocalFrame frame = find(s, request.params.at("id"));
  require_match(request, etag(frame));
  value_or_problem(s.frames.remove(frame.id, frame.version));
  s.audit(request, "frame.delete " + frame.name);
  Response response;
  response.status = 204;
  return response;
}

/// Published positions on the globe, for pairs that name an anchor.
std::optional<Wgs84> published_place(AnchorApi& s, NetworkId anchor) {
  for (const auto& position : value_or_problem(s.revisions.published(std::nullopt))) {
    if (position.estimate.anchor == anchor && position.estimate.best) return position.estimate.best->wgs84;
  }
  return std::nullopt;
}

Response fit(AnchorApi& s, const Request& request) {
  LocalFrame frame = find(s, request.params.at("id"));
  std::vector<FieldError> errors;
  auto wanted = read_fit_request(json_body(request), errors);
  for (std::size_t i = 0; i < wanted.pairs.size(); ++i) {
    auto& pair = wanted.pairs[i];
    if (!pair.anchor) continue;
    pair.wgs84 = published_place(s, *pair.anchor);
    if (!pair.wgs84)
      errors.push_back({"/pairs/" + std::to_string(i) + "/anchor", "no_position",
                        to_string(*pair.anchor) + " has no published position on the globe"});
  }
  refuse_if_any(errors);
  FrameDefinition definition;
  definition.origin = *wanted.pairs.front().wgs84;
  if (frame.site) {
    const auto site = value_or_problem(s.sites.site(*frame.site));
    if (site.origin) definition.origin = *site.origin;
  }
  const EnuFrame enu(definition.origin);
  for (auto& pair : wanted.pairs) {
    pair.pair.enu_m = enu.enu_from_wgs84(*pair.wgs84).m;
    definition.pairs.push_back(pair.pair);
  }
  definition.fit = value_or_problem(fit_frame(definition.pairs, wanted.options));
  definition.fitted = s.clock.now();
  frame.definition = {frame_definition_json(definition)};
  value_or_problem(s.frames.update(frame, frame.version));
  ++frame.version;
  s.audit(request, "frame.fit " + frame.name);
  return answer(200, frame);
}

/// What a transformation needs to know, each thing only when one of its ends asks for it.
struct Context {
  std::optional<FrameDefinition> frame{};
  std::optional<EnuFrame> enu{};
  const Projection* projection{nullptr};
  std::optional<SourceCrs> source{};

  Wgs84 geo_from(Space space, const Eigen::Vector3d& at) const {
    switch (space) {
      case Space::geo:
        return {at.y(), at.x(), at.z()};
      case Space::enu:
        return enu->wgs84_from_enu({at});
      case Space::projected:
        return value_or_problem(projection->geographic(at.head<2>(), at.z()));
      case Space::local:
        return EnuFrame(frame->origin).wgs84_from_enu({frame->fit.transform.enu_from(at)});
      case Space::crs:
        return value_or_problem(source->wgs84(at));
    }
    return {};
  }
  Eigen::Vector3d to(Space space, const Wgs84& at) const {
    switch (space) {
      case Space::geo:
        return {at.lon_deg, at.lat_deg, at.height_m};
      case Space::enu:
        return enu->enu_from_wgs84(at).m;
      case Space::projected: {
        const auto map = value_or_problem(projection->easting_northing_m(at));
        return {map.x(), map.y(), at.height_m};
      }
      case Space::local:
        return frame->fit.transform.local_from(EnuFrame(frame->origin).enu_from_wgs84(at).m);
      case Space::crs:
        break;  // refused before: nobody asks for it
    }
    return {};
  }
};

std::optional<Eigen::Vector3d> three_numbers(const nlohmann::json& point) {
  if (!point.is_array() || point.size() != 3) return std::nullopt;
  for (const auto& number : point)
    if (!number.is_number()) return std::nullopt;
  return Eigen::Vector3d(point[0].get<double>(), point[1].get<double>(), point[2].get<double>());
}

/// What a request says of positions of another system.
SourceCrsSpec read_source(Fields& fields, bool wanted) {
  SourceCrsSpec spec;
  const auto crs = fields.text("crs", 40, wanted), heights = fields.text("heights", 40);
  spec.crs = crs.value_or("");
  spec.max_datum_error_m = fields.number("max_datum_error_m", 0, 100).value_or(spec.max_datum_error_m);
  if (heights) {
    if (const auto read = read_heights(*heights, spec); !read)
      fields.error("heights", "unknown_value", read.error().message);
  }
  return spec;
}

Ordered source_json(const SourceCrs& source, const Eigen::Vector3d& first) {
  return {{"name", source.name()},
          {"datum", source.datum()},
          {"datum_error_m", source.datum_error_m()},
          {"heights", source.heights()},
          {"convergence_deg", source.convergence_rad(first) * 180 / std::numbers::pi}};
}

Response transform(AnchorApi& s, const Request& request) {
  std::vector<FieldError> errors;
  const auto body = json_body(request);
  Fields fields(body, "", errors);
  const auto from = fields.word("from", k_space_words, true), to = fields.word("to", k_space_words, true);
  const auto frame_name = fields.text("frame", 80);
  const auto site_text = fields.text("site", 36);
  const auto* points = fields.child("points");
  const SourceCrsSpec spec = read_source(fields, from == Space::crs);
  fields.finish();
  if (to == Space::crs) errors.push_back({"/to", "unknown_value", "crs is allowed only in from"});
  if (points == nullptr || !points->is_array() || points->size() > 10'000)
    errors.push_back({"/points", "wrong_type", "must be an array of at most 10000 points"});
  refuse_if_any(errors);
  const auto uses = [&](Space space) { return *from == space || *to == space; };
  Context context;
  std::optional<Site> site;
  std::optional<LocalFrame> frame;
  if (frame_name) frame = find(s, *frame_name);
  if (uses(Space::local)) {
    if (frame) context.frame = frame_definition(*frame);
    if (!context.frame) errors.push_back({"/frame", "not_fitted", "give a frame that has been fitted"});
  }
  if (site_text) {
    const auto id = parse_uuid(*site_text);
    if (id)
      site = value_or_problem(s.sites.site(SiteId{id.value()}));
    else
      errors.push_back({"/site", "bad_id", id.error().message});
  } else if (frame && frame->site) {
    site = value_or_problem(s.sites.site(*frame->site));
  }
  if (uses(Space::enu)) {
    if (site && site->origin)
      context.enu.emplace(*site->origin);
    else if (context.frame)
      context.enu.emplace(context.frame->origin);
    else
      errors.push_back({"/site", "no_origin", "give a site with an origin"});
  }
  if (uses(Space::projected)) {
    if (!site || !site->projected_epsg) {
      errors.push_back({"/site", "no_epsg", "give a site with projected_epsg"});
    } else {
      const auto projection = s.geo.projection(*site->projected_epsg, *site);
      if (projection)
        context.projection = projection.value();
      else
        errors.push_back({"/site", "no_projection", projection.error().message});
    }
  }
  const auto first = points->empty() ? std::nullopt : three_numbers(points->front());
  if (from == Space::crs && first) {
    if (auto source = SourceCrs::open(spec, *first))
      context.source.emplace(std::move(source).value());
    else
      errors.push_back({"/crs", "no_crs", source.error().message});
  }
  refuse_if_any(errors);
  Ordered out = Ordered::array();
  for (std::size_t i = 0; i < points->size(); ++i) {
    const auto at = three_numbers((*points)[i]);
    if (!at || (from == Space::geo && std::abs(at->y()) > 90)) {
      errors.push_back({"/points/" + std::to_string(i), "wrong_type", "must be three numbers"});
      continue;
    }
    if (!errors.empty()) continue;  // the first point may be none, and then there is no system
    const auto there = context.to(*to, context.geo_from(*from, *at));
    out.push_back({there.x(), there.y(), there.z()});
  }
  refuse_if_any(errors);
  Ordered moved{
      {"from", k_space_words.word(*from)}, {"to", k_space_words.word(*to)}, {"points", std::move(out)}};
  if (context.source) moved["source"] = source_json(*context.source, *first);
  return json_response(200, moved);
}

}  // namespace

void add_frame_routes(Router& router, AnchorApi& s) {
  const auto on = [&s](auto function) {
    return [&s, function](const Request& request) { return function(s, request); };
  };
  const auto engineer = Access::any_of({Role::engineer});
  router.add({Method::get, "/api/v1/frames", readers(), on(list_frames)});
  router.add({Method::post, "/api/v1/frames", engineer, on(create_frame)});
  router.add({Method::get, "/api/v1/frames/{id}", readers(), [&s](const Request& request) {
                check_query(request, {});
                return answer(200, find(s, request.params.at("id")));
              }});
  router.add({Method::patch, "/api/v1/frames/{id}", engineer, on(patch_frame), 1 << 20, false, true});
  router.add({Method::del, "/api/v1/frames/{id}", engineer, on(remove_frame), 1 << 20, false, true});
  router.add(as_heavy({Method::post, "/api/v1/frames/{id}/fit", engineer, on(fit)}));
  router.add(keeps_nothing(as_heavy({Method::post, "/api/v1/transform", readers(), on(transform)})));
}

}  // namespace anchord::api
