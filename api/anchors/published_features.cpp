#include "api/anchors/published_features.hpp"

#include <algorithm>
#include <charconv>
#include <map>
#include <nlohmann/json.hpp>

#include "api/anchors/contradiction_watch.hpp"
#include "api/anchors/frame_json.hpp"
#include "api/anchors/geo_service.hpp"
#include "api/anchors/routes.hpp"
#include "api/anchors/site_json.hpp"
#include "api/kit/current_sites.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/support.hpp"
#include "api/wire/budget_json.hpp"
#include "core/base/to_wire.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/anchor_store.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/frame_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {

using Ordered = nlohmann::ordered_json;

struct FeatureLookup::State {
  explicit State(AnchorApi& services) : services_(services) {}
  std::optional<Site> site(const std::optional<SiteId>& id) {
    if (!id) return std::nullopt;
    auto [it, fresh] = sites_.try_emplace(*id);
    if (fresh) {
      if (auto found = services_.sites.site(*id)) it->second = std::move(found).value();
    }
    return it->second;
  }
  AnchorGoal goal(const PublishedPosition& position) {
    return services_.goals.of(position.estimate.anchor, calibration(position.calibration).flown);
  }
  const std::vector<MissionId>& missions(const CalibrationId& id) { return calibration(id).missions; }
  /// Of a published place that a fitted frame gave.
  std::optional<GlobeAccuracy> globe(const PublishedPosition& position) {
    if (position.frame != TrackFrame::local) return std::nullopt;
    return globe_accuracy(calibration(position.calibration).provenance, position.estimate.anchor);
  }

  void set_base_of(const PublishedPosition& position, Site& site) {
    const Ordered& provenance = calibration(position.calibration).provenance;
    if (provenance.is_object() && provenance.contains("base")) set_site_base(provenance["base"], site);
  }

  /// What its uncertainty comes from; empty where the calibration is of before budgets.
  std::string budget(const PublishedPosition& position) {
    const Ordered kept = kept_budget(calibration(position.calibration).provenance, position.estimate.anchor);
    return kept.is_null() ? std::string{} : to_wire(kept);
  }

  /// What the position is called elsewhere: the positioning system's frame, the map, sea level.
  void name_elsewhere(AnchorFeature& feature) {
    if (!feature.estimate || !feature.estimate->best || !feature.estimate->best->wgs84) return;
    const Wgs84& at = *feature.estimate->best->wgs84;
    const auto map = services_.geo.projected(feature.site, at);
    if (map)
      feature.projected = {map.value().epsg, map.value().easting_northing_m.x(),
                           map.value().easting_northing_m.y()};
    else
      feature.projected_reason = map.error().message;
    const auto height = services_.geo.orthometric(at);
    if (height) feature.height_orthometric_m = height.value().height_m;
    feature.geoid = height ? height.value().geoid : height.error().message;
    if (const auto* frame = local_frame(feature.anchor.site))
      feature.local_m = frame->fit.transform.local_from(EnuFrame(frame->origin).enu_from_wgs84(at).m);
  }

  /// The first fitted frame of the site.
  const FrameDefinition* local_frame(const std::optional<SiteId>& site) {
    if (!site) return nullptr;
    auto [it, fresh] = frames_.try_emplace(*site);
    if (fresh) {
      if (const auto found = services_.frames.frames_of(*site)) {
        for (const auto& frame : found.value()) {
          if (!it->second) it->second = frame_definition(frame);
        }
      }
    }
    return it->second ? &*it->second : nullptr;
  }

  struct Made {
    std::vector<MissionId> missions;
    std::vector<PlanTargets> flown;
    Ordered provenance;
  };
  const Made& calibration(const CalibrationId& id) {
    auto [it, fresh] = calibrations_.try_emplace(id);
    if (fresh) {
      if (auto found = services_.calibrations.calibration(id))
        it->second = {found.value().missions, services_.goals.flown(found.value().missions),
                      Ordered::parse(found.value().provenance.text, nullptr, false)};
    }
    return it->second;
  }

  AnchorApi& services_;
  std::map<SiteId, std::optional<FrameDefinition>> frames_;
  std::map<SiteId, std::optional<Site>> sites_;
  std::map<CalibrationId, Made> calibrations_;
};

FeatureLookup::FeatureLookup(AnchorApi& services) : state_(std::make_unique<State>(services)) {}
FeatureLookup::~FeatureLookup() = default;

std::optional<Site> FeatureLookup::site(const std::optional<SiteId>& id) { return state_->site(id); }
std::optional<GlobeAccuracy> FeatureLookup::globe(const PublishedPosition& position) {
  return state_->globe(position);
}

AnchorFeature FeatureLookup::feature(Anchor anchor, const PublishedPosition& position, std::uint64_t revision,
                                     bool history) {
  AnchorFeature feature;
  feature.site = state_->site(anchor.site);
  if (history && feature.site) state_->set_base_of(position, *feature.site);
  feature.anchor = std::move(anchor);
  feature.status = feature.anchor.retired ? "retired" : "accepted";
  feature.revision = revision;
  feature.calibrated = position.published;
  feature.calibration = position.calibration;
  feature.missions = state_->missions(position.calibration);
  feature.frame = position.frame;
  feature.estimate = position.estimate;
  feature.goal = state_->goal(position);
  feature.overridden = position.overridden;
  feature.globe = state_->globe(position);
  feature.budget_json = state_->budget(position);
  state_->name_elsewhere(feature);
  return feature;
}

Anchor anchor_as_stored(AnchorApi& s, NetworkId id) {
  auto found = s.anchors.anchor(id);
  if (found || found.error().code != Errc::not_found) return value_or_problem(std::move(found));
  Anchor anchor;
  anchor.network_id = id;
  return anchor;
}

namespace {

/// A later flight found it elsewhere: no reader may take it for accepted. A flight that the reader does not
/// see is not there to contradict.
void contradict(AnchorApi& s, AnchorFeature& feature, const ContradictedAnchor& against) {
  if (feature.anchor.retired) return;
  if (!current_sites().all() && !s.calibrations.calibration(against.calibration)) return;
  feature.status = "contradicted";
  feature.contradicted = {against.calibration, to_wire(contradiction_json(against)), against.text};
  feature.estimate->gates.push_back(
      {"contradicted", against.what.chi2, against.what.limit, false, against.text});
}

}  // namespace

std::uint64_t newest_revision(AnchorApi& s) {
  const auto newest = value_or_problem(s.revisions.revisions(1, 0));
  return newest.empty() ? 0 : newest.front().number;
}

std::vector<AnchorFeature> published_features(AnchorApi& s, std::optional<std::uint64_t> revision,
                                              std::uint64_t& number) {
  number = revision ? *revision : newest_revision(s);
  if (number == 0) return {};
  FeatureLookup lookup(s);
  const auto contradicted = s.contradictions.standing();
  const bool newest = !revision || number == newest_revision(s);
  std::vector<AnchorFeature> out;
  for (const auto& position : value_or_problem(s.revisions.published(number))) {
    auto anchor = anchor_as_stored(s, position.estimate.anchor);
    out.push_back(lookup.feature(std::move(anchor), position, number, !newest));
    const auto against = contradicted->find(position.estimate.anchor);
    // What an older revision said is history; only the newest is what readers build on.
    if (newest && against != contradicted->end()) contradict(s, out.back(), against->second);
  }
  std::sort(out.begin(), out.end(),
            [](const auto& a, const auto& b) { return a.anchor.network_id < b.anchor.network_id; });
  return out;
}

std::optional<AnchorFeature> published_feature(AnchorApi& s, const Anchor& anchor) {
  const auto number = newest_revision(s);
  const auto position = value_or_problem(s.revisions.position(anchor.network_id, number));
  if (!position) return std::nullopt;
  FeatureLookup lookup(s);
  auto out = lookup.feature(anchor, *position, number);
  const auto contradicted = s.contradictions.standing();
  if (const auto against = contradicted->find(anchor.network_id); against != contradicted->end())
    contradict(s, out, against->second);
  return out;
}

RevisionCursor revision_cursor(const std::string& text) {
  const auto dot = text.find('.');
  RevisionCursor out{text.substr(0, dot)};
  if (dot == std::string::npos) return out;
  std::uint64_t number = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + dot + 1, end, number);
  if (error == std::errc{} && stop == end && number > 0)
    out.revision = number;
  else
    out.after = text;  // which no anchor is
  return out;
}

std::string revision_cursor_text(const std::string& after, std::uint64_t revision) {
  return revision == 0 ? after : after + '.' + std::to_string(revision);
}

}  // namespace anchord::api
