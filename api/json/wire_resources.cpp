#include "api/json/wire_resources.hpp"

#include <nlohmann/json.hpp>

#include "api/json/budget_json.hpp"
#include "api/json/live_writer.hpp"
#include "api/json/reader.hpp"
#include "api/json/word_table.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {

using Json = nlohmann::json;
using Ordered = nlohmann::ordered_json;

namespace {

Ordered wgs84_json(const std::optional<Wgs84>& at) {
  if (!at) return nullptr;
  return {{"lon", at->lon_deg}, {"lat", at->lat_deg}, {"h_m", at->height_m}};
}

template <class T>
Ordered or_null(const std::optional<T>& value) {
  if (!value) return nullptr;
  return *value;
}

/// Longest texts of facility data; beyond it somebody pastes a document into a field.
constexpr auto k_frames =
    std::to_array<Word<TrackFrame>>({{"wgs84", TrackFrame::wgs84}, {"local", TrackFrame::local}});
constexpr auto k_points = std::to_array<Word<TrackPoint>>({{"gnss_antenna", TrackPoint::gnss_antenna},
                                                           {"body", TrackPoint::body},
                                                           {"tag_antenna", TrackPoint::tag_antenna}});
constexpr std::size_t k_max_text = 200;

/// In a merge-patch null clears, absent keeps.
void patch_text(Fields& fields, const Json& body, const char* key, std::string& target) {
  if (auto text = fields.text(key, k_max_text))
    target = *text;
  else if (body.is_object() && body.contains(key) && body[key].is_null())
    target.clear();
}

}  // namespace

Ordered mission_json(const Mission& mission, std::optional<std::uint64_t> n_ranges,
                     std::optional<std::uint64_t> n_fixes) {
  static constexpr std::array k_points{"gnss_antenna", "body", "tag_antenna"};
  Ordered tags = Ordered::array();
  for (const auto& tag : mission.tags) {
    const auto& arm = tag.lever_arm_body_m;
    tags.push_back({{"tag", to_string(tag.tag)},
                    {"antenna", tag.antenna},
                    {"lever_arm_body_m", {arm.x(), arm.y(), arm.z()}}});
  }
  Ordered out{{"id", to_string(mission.id)}, {"name", mission.name}};
  out["site"] = mission.site ? Ordered(to_string(*mission.site)) : Ordered(nullptr);
  out["kit"] = mission.kit;
  out["radio"] = mission.radio;
  out["frame"] = mission.frame == TrackFrame::wgs84 ? "wgs84" : "local";
  out["track_point"] = k_points[static_cast<std::size_t>(mission.point)];
  out["tags"] = std::move(tags);
  out["state"] = mission_state_word(mission.state);
  out["created_at"] = to_rfc3339(mission.created);
  out["finished_at"] = mission.finished ? Ordered(to_rfc3339(*mission.finished)) : Ordered(nullptr);
  out["n_ranges"] = or_null(n_ranges);
  out["n_fixes"] = or_null(n_fixes);
  return out;
}

Mission read_mission(const Json& body, std::vector<FieldError>& errors) {
  Mission mission;
  Fields fields(body, "", errors);
  if (const auto text = fields.text("name", k_max_text, true)) mission.name = *text;
  if (const auto text = fields.text("kit", k_max_text)) mission.kit = *text;
  if (const auto text = fields.text("radio", k_max_text)) mission.radio = *text;
  if (const auto text = fields.text("site", 36)) {
    const auto id = parse_uuid(*text);
    if (id)
      mission.site = SiteId{id.value()};
    else
      fields.error("site", "bad_id", id.error().message);
  }
  if (const auto frame = value_of_word(fields, "frame", k_frames, true)) mission.frame = *frame;
  // Required: an arm applied to the wrong point is a silent error of decimetres.
  if (const auto point = value_of_word(fields, "track_point", k_points, true)) mission.point = *point;
  if (const Json* tags = fields.child("tags")) {
    if (!tags->is_array() || tags->size() > 64) {
      fields.error("tags", "wrong_type", "must be an array of at most 64 tag antennas");
    } else {
      for (std::size_t i = 0; i < tags->size(); ++i) {
        Fields inner((*tags)[i], "/tags/" + std::to_string(i), errors);
        TagAntenna tag;
        if (const auto text = inner.text("tag", 20, true)) {
          const auto id = parse_network_id(*text);
          if (id)
            tag.tag = id.value();
          else
            inner.error("tag", "bad_id", id.error().message);
        }
        if (const auto n = inner.integer("antenna", 0, 255)) tag.antenna = static_cast<std::uint8_t>(*n);
        if (const auto arm = inner.numbers("lever_arm_body_m", 3, -100, 100, true))
          tag.lever_arm_body_m = {(*arm)[0], (*arm)[1], (*arm)[2]};
        inner.finish();
        for (const auto& other : mission.tags) {
          if (other.tag == tag.tag && other.antenna == tag.antenna)
            inner.error("tag", "duplicate", "this antenna of the tag occurs twice");
        }
        mission.tags.push_back(tag);
      }
    }
  }
  fields.finish();
  return mission;
}

Ordered site_json(const Site& site) {
  Ordered out{{"id", to_string(site.id)}, {"name", site.name}, {"origin", wgs84_json(site.origin)}};
  out["outline"] = kept_json(site.outline_geojson);
  out["crs"] = {{"frame", site.crs_frame.empty() ? Ordered(nullptr) : Ordered(site.crs_frame)},
                {"epoch", or_null(site.crs_epoch)},
                {"base",
                 {{"source", site.base_source.empty() ? Ordered(nullptr) : Ordered(site.base_source)},
                  {"sigma_m", or_null(site.base_sigma_m)}}}};
  out["projected_epsg"] = or_null(site.projected_epsg);
  out["created_at"] = to_rfc3339(site.created);
  return out;
}

void patch_site(const Json& body, bool whole, Site& site, std::vector<FieldError>& errors) {
  Fields fields(body, "", errors);
  if (!fields.is_object()) return;
  const auto cleared = [&](const char* key) { return body.contains(key) && body[key].is_null(); };
  if (const auto text = fields.text("name", k_max_text, whole)) site.name = *text;
  if (const Json* origin = fields.child("origin")) {
    Fields inner(*origin, "/origin", errors);
    const auto lon = inner.number("lon", -180, 180, true), lat = inner.number("lat", -90, 90, true),
               height = inner.number("h_m", -500, 9000, true);
    inner.finish();
    if (lon && lat && height) site.origin = Wgs84{*lat, *lon, *height};
  } else if (cleared("origin")) {
    site.origin.reset();
  }
  if (const Json* outline = fields.child("outline")) {
    const bool polygon = outline->is_object() && outline->value("type", Json()) == "Polygon" &&
                         outline->contains("coordinates") && (*outline)["coordinates"].is_array();
    if (!polygon || to_wire(*outline).size() > 100'000)
      fields.error("outline", "wrong_type", "must be a GeoJSON Polygon below 100 kB");
    else
      site.outline_geojson = to_wire(*outline);
  } else if (cleared("outline")) {
    site.outline_geojson.clear();
  }
  if (const Json* crs = fields.child("crs")) {
    Fields inner(*crs, "/crs", errors);
    patch_text(inner, *crs, "frame", site.crs_frame);
    if (const auto epoch = inner.number("epoch", 1900, 2200)) site.crs_epoch = *epoch;
    if (const Json* base = inner.child("base")) {
      Fields deepest(*base, "/crs/base", errors);
      static const std::vector<std::string_view> k_sources{"known_point", "survey_in", "network"};
      if (const auto source = deepest.word("source", k_sources)) site.base_source = k_sources[*source];
      if (const auto sigma = deepest.number("sigma_m", 0, 100)) site.base_sigma_m = *sigma;
      deepest.finish();
    }
    inner.finish();
  }
  if (const auto epsg = fields.integer("projected_epsg", 1024, 999'999))
    site.projected_epsg = static_cast<int>(*epsg);
  else if (cleared("projected_epsg"))
    site.projected_epsg.reset();
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
        const auto system = inner.text("system", 60, true), id = inner.text("id", k_max_text, true);
        inner.finish();
        if (system && id) anchor.external_ids.emplace_back(*system, *id);
      }
    }
  } else if (body.contains("external_ids") && body["external_ids"].is_null()) {
    anchor.external_ids.clear();
  }
  fields.finish();
}

Ordered calibration_json(const Calibration& calibration, bool with_anchors) {
  Ordered missions = Ordered::array();
  for (const auto& id : calibration.missions) missions.push_back(to_string(id));
  Ordered out{{"id", to_string(calibration.id)},
              {"created_at", to_rfc3339(calibration.created)},
              {"missions", std::move(missions)},
              {"frame", calibration.frame == TrackFrame::wgs84 ? "wgs84" : "local"},
              {"origin", wgs84_json(calibration.origin)}};
  auto settings = Ordered::parse(calibration.settings_json, nullptr, false);
  out["settings"] = settings.is_discarded() ? Ordered::object() : std::move(settings);
  auto provenance = Ordered::parse(calibration.provenance_json, nullptr, false);
  out["provenance"] = provenance.is_object() ? std::move(provenance) : Ordered::object();
  if (!with_anchors) return out;
  Ordered anchors = Ordered::array();
  for (const auto& estimate : calibration.anchors) {
    anchors.push_back(estimate_result_json(estimate, calibration.frame, std::nullopt, std::nullopt,
                                           globe_accuracy(out["provenance"], estimate.anchor)));
    // Told in a local frame too, where the calibration asked for one.
    const auto local = Ordered::json_pointer("/frame/anchors/" + to_string(estimate.anchor));
    if (out["provenance"].contains(local)) anchors.back()["local_m"] = out["provenance"][local];
    anchors.back()["budget"] = kept_budget(out["provenance"], estimate.anchor);
  }
  out["anchors"] = std::move(anchors);
  out["provenance"].erase("budgets");  // each is with its anchor
  return out;
}

Ordered revision_json(const Revision& revision) {
  return {{"revision", revision.number},
          {"t_us", revision.published.us()},
          {"published_at", to_rfc3339(revision.published)},
          {"calibration", to_string(revision.calibration)},
          {"by", revision.by},
          {"note", revision.note}};
}

Ordered published_json(const PublishedPosition& position, const std::optional<GlobeAccuracy>& globe) {
  Ordered out{{"revision", position.since_revision},
              {"published_at", to_rfc3339(position.published)},
              {"calibration", to_string(position.calibration)}};
  out.update(
      estimate_result_json(position.estimate, position.frame, std::nullopt, position.overridden, globe));
  return out;
}

std::string_view job_state_word(JobState state) {
  switch (state) {
    case JobState::queued:
      return "queued";
    case JobState::running:
      return "running";
    case JobState::succeeded:
      return "succeeded";
    case JobState::failed:
      return "failed";
    case JobState::canceled:
      return "canceled";
  }
  return "failed";
}

Ordered job_json(const Job& job) {
  static const std::vector<std::string> k_solving{"queued", "load", "solve", "store"};
  static const std::vector<std::string> k_training{"queued",     "load",      "split", "search",
                                                   "importance", "selection", "test",  "store"};
  const auto& k_stages = job.kind == "training" ? k_training : k_solving;
  std::size_t stage = 0;
  while (stage + 1 < k_stages.size() && k_stages[stage] != job.stage) ++stage;
  const std::string self = "/api/v1/jobs/" + to_string(job.id);
  Ordered links = Ordered::array();
  if (!job.result_href.empty()) links.push_back({{"rel", "result"}, {"href", job.result_href}});
  if (job.state == JobState::queued || job.state == JobState::running)
    links.push_back({{"rel", "cancel"}, {"href", self}, {"method", "DELETE"}});
  Ordered out{{"id", to_string(job.id)}, {"kind", job.kind}, {"state", job_state_word(job.state)}};
  out["progress"] = {{"fraction", job.fraction},       {"stage", job.stage},   {"stage_index", stage},
                     {"stage_count", k_stages.size()}, {"detail", job.detail}, {"eta_s", nullptr}};
  out["created_at"] = to_rfc3339(job.created);
  out["started_at"] = job.started ? Ordered(to_rfc3339(*job.started)) : Ordered(nullptr);
  out["finished_at"] = job.finished ? Ordered(to_rfc3339(*job.finished)) : Ordered(nullptr);
  out["links"] = std::move(links);
  out["problem"] = kept_json(job.problem_json);
  return out;
}

}  // namespace anchord::api
