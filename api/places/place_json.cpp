#include "api/places/place_json.hpp"

#include <cmath>
#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/places/plan_work.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

std::string etag(const Building& building) { return "\"b-" + std::to_string(building.version) + '"'; }
std::string etag(const Floor& floor) { return "\"f-" + std::to_string(floor.version) + '"'; }

Ordered building_json(const Building& b) {
  return {{"id", to_string(b.id)},
          {"site", to_string(b.site)},
          {"name", b.name},
          {"height_m", or_null(b.height_m)},
          {"created_at", to_rfc3339(b.created)}};
}

namespace {

Ordered tiles_json(const Floor& f, const Ordered& origin) {
  const auto& t = f.tiles.value();
  Ordered levels = Ordered::array();
  for (int level = 0; level < t.n_levels; ++level)
    levels.push_back({{"level", level},
                      {"m_per_px", std::ldexp(t.m_per_px, t.n_levels - 1 - level)},
                      {"columns", tile_columns(t, level)},
                      {"rows", tile_rows(t, level)}});
  return {{"href", "/api/v1/floors/" + to_string(f.id) + "/plan/tiles/{level}/{column}/{row}"},
          {"origin", origin},
          {"north_west_m", {t.west_m, t.north_m}},
          {"tile_px", floor_plan::k_tile_px},
          {"levels", std::move(levels)},
          {"bytes", t.bytes},
          {"sha256", t.sha256_hex}};
}

}  // namespace

Ordered floor_json(const Floor& f) {
  Ordered out{{"id", to_string(f.id)},
              {"building", to_string(f.building)},
              {"name", f.name},
              {"level", f.level},
              {"base_height_m", or_null(f.base_height_m)},
              {"plan", nullptr},
              {"georeference", kept_json(f.georeference.text)},
              {"backdrop", nullptr},
              {"tiles", nullptr},
              {"tiles_missing", nullptr},
              {"traced", !f.proposal.empty()},
              {"outline", nullptr},
              {"n_walls", 0}};
  if (f.plan) {
    out["plan"] = {{"media_type", f.plan->media_type},
                   {"width_px", f.plan->width_px},
                   {"height_px", f.plan->height_px},
                   {"bytes", f.plan->bytes},
                   {"sha256", f.plan->sha256_hex}};
  }
  if (f.preview)
    out["plan"]["preview"] = {{"width_px", f.preview->width_px}, {"height_px", f.preview->height_px}};
  if (f.backdrop && out["georeference"].is_object() && out["georeference"].contains("extent_m")) {
    out["backdrop"] = {{"href", "/api/v1/floors/" + to_string(f.id) + "/plan/backdrop"},
                       {"origin", out["georeference"]["origin"]},
                       {"extent_m", out["georeference"]["extent_m"]},
                       {"width_px", f.backdrop->width_px},
                       {"height_px", f.backdrop->height_px},
                       {"sha256", f.backdrop->sha256_hex}};
  }
  if (f.tiles && out["backdrop"].is_object())
    out["tiles"] = tiles_json(f, out["georeference"]["origin"]);
  else if (out["backdrop"].is_object())
    out["tiles_missing"] = out["georeference"].value(
        "tiles_missing",
        "the plan was georeferenced by a version that made no tiles: PUT .../plan/georeference again");
  for (const char* ours : {"extent_m", "tiles_missing"})
    if (out["georeference"].is_object()) out["georeference"].erase(ours);
  if (const auto kept = kept_json(f.structure.text); kept.is_object()) {
    out["outline"] = kept.value("outline", Ordered());
    out["n_walls"] = kept.contains("walls") ? kept["walls"].size() : 0;
  }
  out["created_at"] = to_rfc3339(f.created);
  return out;
}

}  // namespace anchord::api
