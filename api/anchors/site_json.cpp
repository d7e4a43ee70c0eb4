#include "api/anchors/site_json.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/wire/row_limits.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

/// In a merge-patch null clears, absent keeps.
void patch_text(Fields& fields, const Json& body, const char* key, std::string& target) {
  if (auto text = fields.text(key, record_limits::k_name))
    target = *text;
  else if (body.is_object() && body.contains(key) && body[key].is_null())
    target.clear();
}

}  // namespace

Ordered wgs84_json(const std::optional<Wgs84>& at) {
  if (!at) return nullptr;
  return {{"lon", at->lon_deg}, {"lat", at->lat_deg}, {"h_m", at->height_m}};
}

Ordered site_json(const Site& site) {
  Ordered out{{"id", to_string(site.id)}, {"name", site.name}, {"origin", wgs84_json(site.origin)}};
  out["outline"] = polygon_of<Ordered>(site.outline);
  out["crs"] = {{"frame", site.crs_frame.empty() ? Ordered(nullptr) : Ordered(site.crs_frame)},
                {"epoch", or_null(site.crs_epoch)},
                {"base",
                 {{"source", site.base_source.empty() ? Ordered(nullptr) : Ordered(site.base_source)},
                  {"sigma_m", or_null(site.base_sigma_m)}}}};
  out["projected_epsg"] = or_null(site.projected_epsg);
  out["organization"] = site.organization ? Ordered(to_string(*site.organization)) : Ordered(nullptr);
  out["created_at"] = to_rfc3339(site.created);
  return out;
}

void patch_site(const Json& body, bool whole, Site& site, std::vector<FieldError>& errors) {
  Fields fields(body, "", errors);
  if (!fields.is_object()) return;
  const auto cleared = [&](const char* key) { return body.contains(key) && body[key].is_null(); };
  if (const auto text = fields.text("name", record_limits::k_name, whole)) site.name = *text;
  if (const Json* origin = fields.child("origin")) {
    Fields inner(*origin, "/origin", errors);
    const auto lon = inner.number("lon", -180, 180, true), lat = inner.number("lat", -90, 90, true),
               height = inner.number("h_m", row_limits::k_height_m.min, row_limits::k_height_m.max, true);
    inner.finish();
    if (lon && lat && height) site.origin = Wgs84{*lat, *lon, *height};
  } else if (cleared("origin")) {
    site.origin.reset();
  }
  if (const Json* outline = fields.child("outline")) {
    std::string wrong;
    auto rings = rings_of(*outline, wrong);
    if (!rings || to_wire(*outline).size() > record_limits::k_outline_bytes)
      errors.push_back({"/outline" + wrong, "wrong_type",
                        "must be a GeoJSON Polygon below 100 kB, its corners [lon, lat] in degrees"});
    else
      site.outline = *std::move(rings);
  } else if (cleared("outline")) {
    site.outline.clear();
  }
  if (const Json* crs = fields.child("crs")) {
    Fields inner(*crs, "/crs", errors);
    patch_text(inner, *crs, "frame", site.crs_frame);
    if (const auto epoch =
            inner.number("epoch", record_limits::k_crs_epoch_year.min, record_limits::k_crs_epoch_year.max))
      site.crs_epoch = *epoch;
    if (const Json* base = inner.child("base")) {
      Fields deepest(*base, "/crs/base", errors);
      if (auto source = deepest.word("source", record_limits::k_base_sources))
        site.base_source = *std::move(source);
      if (const auto sigma =
              deepest.number("sigma_m", record_limits::k_base_sigma_m.min, record_limits::k_base_sigma_m.max))
        site.base_sigma_m = *sigma;
      deepest.finish();
    }
    inner.finish();
  }
  if (const auto epsg =
          fields.integer("projected_epsg", record_limits::k_epsg.min, record_limits::k_epsg.max))
    site.projected_epsg = static_cast<int>(*epsg);
  else if (cleared("projected_epsg"))
    site.projected_epsg.reset();
  if (const auto text = fields.text("organization", 36)) {
    const auto id = parse_uuid(*text);
    if (id)
      site.organization = OrganizationId{id.value()};
    else
      fields.error("organization", "bad_id", id.error().message);
  } else if (cleared("organization")) {
    site.organization.reset();
  }
  fields.finish();
}

void patch_anchor(const Json& body, Anchor& anchor, std::vector<FieldError>& errors) {
  Fields fields(body, "", errors);
  if (!fields.is_object()) return;
  patch_text(fields, body, "name", anchor.name);
  patch_text(fields, body, "building", anchor.building);
  patch_text(fields, body, "floor", anchor.floor);
  patch_text(fields, body, "space", anchor.space);
  patch_text(fields, body, "asset_tag", anchor.asset_tag);
  patch_text(fields, body, "ifc_guid", anchor.ifc_guid);
  if (const auto retired = fields.boolean("retired")) anchor.retired = *retired;
  if (const auto text = fields.text("site", 36)) {
    const auto id = parse_uuid(*text);
    if (id)
      anchor.site = SiteId{id.value()};
    else
      fields.error("site", "bad_id", id.error().message);
  } else if (body.contains("site") && body["site"].is_null()) {
    anchor.site.reset();
  }
  if (const Json* ids = fields.child("external_ids")) {
    if (!ids->is_array() || ids->size() > 32) {
      fields.error("external_ids", "wrong_type", "must be an array of at most 32 {system, id}");
    } else {
      anchor.external_ids.clear();
      for (std::size_t i = 0; i < ids->size(); ++i) {
        Fields inner((*ids)[i], "/external_ids/" + std::to_string(i), errors);
        const auto system = inner.text("system", record_limits::k_external_system, true),
                   id = inner.text("id", record_limits::k_name, true);
        inner.finish();
        if (system && id) anchor.external_ids.emplace_back(*system, *id);
      }
    }
  } else if (body.contains("external_ids") && body["external_ids"].is_null()) {
    anchor.external_ids.clear();
  }
  fields.finish();
}

Ordered site_base_json(const Site& site) {
  const auto text = [](const std::string& t) { return t.empty() ? Ordered(nullptr) : Ordered(t); };
  return {{"site", to_string(site.id)},
          {"frame", text(site.crs_frame)},
          {"epoch", site.crs_epoch ? Ordered(*site.crs_epoch) : Ordered(nullptr)},
          {"source", text(site.base_source)},
          {"sigma_m", site.base_sigma_m ? Ordered(*site.base_sigma_m) : Ordered(nullptr)}};
}

void set_site_base(const Ordered& base, Site& site) {
  if (!base.is_object() || base.value("site", Ordered()) != to_string(site.id)) return;
  const auto text = [&](const char* name, std::string& to) {
    if (base.contains(name)) to = base[name].is_string() ? base[name].get<std::string>() : "";
  };
  const auto number = [&](const char* name, std::optional<double>& to) {
    if (base.contains(name))
      to = base[name].is_number() ? std::optional(base[name].get<double>()) : std::nullopt;
  };
  text("frame", site.crs_frame);
  number("epoch", site.crs_epoch);
  text("source", site.base_source);
  number("sigma_m", site.base_sigma_m);
}

}  // namespace anchord::api
