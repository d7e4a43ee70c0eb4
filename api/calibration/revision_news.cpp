#include "api/calibration/revision_news.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/event_log.hpp"
#include "api/anchors/contradiction_watch.hpp"
#include "api/stream/hub.hpp"
#include "core/base/to_wire.hpp"

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

}  // namespace anchord::api
