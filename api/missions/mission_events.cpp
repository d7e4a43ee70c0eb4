#include "api/admin/event_log.hpp"
#include "api/missions/mission_observer.hpp"
#include "api/missions/mission_service_state.hpp"
#include "api/stream/hub.hpp"
#include "core/flight/hand_over.hpp"

namespace anchord::api {

void MissionService::State::publish_events(Flight& flight, Flight::Work& work) {
  if (!work.live.has_events()) return;
  auto* pilot = observer.load();
  for (const auto& event : work.live.take_events()) {
    if (pilot != nullptr) flight::report(*pilot, flight.id, event);
    std::visit([&](const auto& one) { publish(flight, one); }, event);
  }
}

void MissionService::State::publish_events(const Flight& flight,
                                           const std::vector<flight::PositionEvent>& events) const {
  auto* pilot = observer.load();
  for (const auto& event : events) {
    if (pilot != nullptr) flight::report(*pilot, event);
    std::visit([&](const auto& one) { publish(flight, one); }, event);
  }
}

void MissionService::State::publish(const Flight& flight, const flight::FixShown& event) const {
  const std::int64_t t_us = event.fix.time.us();
  deps.hub.publish(Topic::rtk_status, live_rtk_json(flight.id, event.fix), t_us, to_string(flight.id), {},
                   flight.id);
  deps.hub.collect(Topic::fixes, live_fix_json(flight.id, event.fix), t_us, flight.id);
}

void MissionService::State::publish(const Flight& flight, const flight::PoseMoved& event) const {
  deps.hub.publish(Topic::drone_pose, live_pose_json(flight.id, flight.frame, event), event.time.us(),
                   to_string(flight.id), {}, flight.id);
}

void MissionService::State::publish(Flight& flight, const flight::RangeDecided& event) {
  const auto& result = event.result;
  deps.hub.collect(Topic::ranges, live_range_json(flight.id, result), result.range.time.us(), flight.id,
                   result.range.anchor);
}

/// From its first range on an anchor has an identity that facility data can hang on.
void MissionService::State::publish(Flight& flight, const flight::AnchorFound& event) {
  later([&anchors = deps.anchors, who = event.anchor, now = deps.clock.now()]() -> Result<void> {
    BOOST_OUTCOME_TRYV(anchors.find_or_create(who, now));
    return boost::outcome_v2::success();
  });
  if (event.now)
    deps.events.add(EventLevel::info, "anchor.found", "anchor " + to_string(event.anchor) + " found",
                    flight.id);
}

void MissionService::State::publish(Flight& flight, const flight::AnchorStatusChanged& event) {
  const bool converged = event.status == "converged";
  deps.events.add(
      converged ? EventLevel::info : EventLevel::warning, "anchor." + std::string(event.status),
      "anchor " + to_string(event.anchor) + (converged ? " converged" : " is ambiguous: " + event.reason),
      flight.id);
}

void MissionService::State::publish(Flight& flight, const flight::AnchorEstimated& event) {
  const auto& estimate = event.estimate;
  deps.hub.publish(Topic::anchors_estimates, live_estimate_json(flight.id, estimate, event.models_moved_m),
                   estimate.time.us(), to_string(flight.id) + to_string(estimate.anchor), estimate.anchor,
                   flight.id);
}

void MissionService::State::publish(Flight& flight, const flight::FixRejected& event) {
  deps.events.add(EventLevel::warning, "track." + event.reason,
                  event.reason == "excluded" ? "positions were excluded by a person"
                                             : "a position was rejected: " + event.reason +
                                                   "; further ones are counted in the state of the flight",
                  flight.id);
}

void MissionService::State::publish(Flight& flight, const flight::OriginMoved&) {
  deps.events.add(
      EventLevel::warning, "track.origin",
      "the first positions did not belong to the flight: its origin is a different one from now on",
      flight.id);
}

}  // namespace anchord::api
