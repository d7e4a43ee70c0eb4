#include "api/calibration/revision_news.hpp"

#include <nlohmann/json.hpp>
#include <set>

#include "api/admin/event_log.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/missions/mission_service.hpp"
#include "api/stream/hub.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/calibration_store.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

namespace {

/// A mission of the one site that a calibration is of; none: it is of several, or of none.
std::optional<MissionId> of_one_site(CalibrationApi& s, const CalibrationId& id) {
  const auto calibration = s.calibration_store.calibration(id);
  if (!calibration) return std::nullopt;
  const auto& missions = calibration.value().missions;
  std::set<std::optional<SiteId>> sites;
  for (const auto& mission : missions) {
    const auto found = s.missions.mission(mission);
    sites.insert(found ? found.value().site : std::nullopt);
  }
  return sites.size() == 1 ? std::optional(missions.front()) : std::nullopt;
}

}  // namespace

void announce_revision(CalibrationApi& s, const Revision& revision, std::size_t anchors,
                       std::size_t overrides) {
  s.contradictions.changed();
  s.hub.publish(Topic::revisions,
                to_wire(nlohmann::ordered_json{{"revision", revision.number},
                                               {"t_us", revision.published.us()},
                                               {"calibration", to_string(revision.calibration)}}),
                revision.published.us(), {}, {}, of_one_site(s, revision.calibration));
  s.events.add(overrides == 0 ? EventLevel::info : EventLevel::warning, "revision.published",
               "revision " + std::to_string(revision.number) + " with " + std::to_string(anchors) +
                   " anchors published" +
                   (overrides == 0 ? "" : ", " + std::to_string(overrides) + " by override"));
}

void announce_bundle(CalibrationApi& s, const MissionId& mission, const std::string& text,
                     bool with_revisions) {
  s.missions.forget(mission);
  s.contradictions.changed();
  s.events.add(EventLevel::info, "bundle.imported", text, mission);
  if (!with_revisions) return;
  const auto newest = s.revisions.revisions(1, 0);
  const auto positions = s.revisions.published(std::nullopt);
  if (newest && positions && !newest.value().empty())
    announce_revision(s, newest.value().front(), positions.value().size(), 0);
}

}  // namespace anchord::api
