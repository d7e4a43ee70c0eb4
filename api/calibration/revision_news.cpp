#include "api/calibration/revision_news.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/missions/mission_service.hpp"
#include "api/stream/hub.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/revision_store.hpp"

namespace anchord::api {

void announce_revision(CalibrationApi& s, const Revision& revision, std::size_t anchors,
                       std::size_t overrides) {
  s.contradictions.changed();
  s.hub.publish(Topic::revisions,
                to_wire(nlohmann::ordered_json{{"revision", revision.number},
                                               {"t_us", revision.published.us()},
                                               {"calibration", to_string(revision.calibration)}}),
                revision.published.us());
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
