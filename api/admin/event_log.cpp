#include "api/admin/event_log.hpp"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "api/kit/current_sites.hpp"
#include "api/stream/hub.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::api {
namespace {

nlohmann::ordered_json place_json(const EventPlace& place) {
  return {
      {"lon", place.lon_deg}, {"lat", place.lat_deg}, {"height_above_ground_m", place.height_above_ground_m}};
}

}  // namespace

std::string event_json(const LiveEvent& event) {
  return R"({"id":")" + to_string(event.id) + R"(","t_us":)" + std::to_string(event.time.us()) +
         R"(,"level":)" + json_text(to_string(event.level)) + R"(,"code":)" + json_text(event.code) +
         R"(,"text":)" + json_text(event.text) + R"(,"mission":)" +
         (event.mission ? json_text(to_string(*event.mission)) : "null") + R"(,"place":)" +
         (event.place ? to_wire(place_json(*event.place)) : "null") + '}';
}

void EventLog::add(EventLevel level, std::string code, std::string text, std::optional<MissionId> mission,
                   std::optional<EventPlace> place) {
  const UtcTime now = clock_.now();
  const LiveEvent event{
      EventId{make_uuid_v7(now)}, now, level, std::move(code), std::move(text), mission, place};
  std::string json = event_json(event);
  {
    auto kept = events_.lock();
    kept->push_back(event);
    if (kept->size() > k_kept) kept->pop_front();
  }
  hub_.publish(Topic::events, std::move(json), now.us(), {}, {}, mission);
  tell_(event);
}

void EventLog::restore(const std::vector<LiveEvent>& events) {
  auto kept = events_.lock();
  const std::size_t room = k_kept - std::min(k_kept, kept->size());
  const auto first = events.end() - static_cast<std::ptrdiff_t>(std::min(room, events.size()));
  kept->insert(kept->begin(), first, events.end());
}

std::vector<LiveEvent> EventLog::newest(std::size_t limit, const std::optional<MissionId>& mission,
                                        std::optional<UtcTime> since) const {
  const SiteSet& sites = current_sites();
  // Of which site a mission is, the hub knows; it is not asked under the lock.
  const std::size_t most = sites.all() ? limit : k_kept;
  std::vector<LiveEvent> out;
  {
    const auto kept = events_.lock();
    for (auto it = kept->rbegin(); it != kept->rend() && out.size() < most; ++it) {
      if (mission && it->mission != mission) continue;
      if (since && it->time < *since) continue;  // not in order of time where the clock was set back
      if (!sites.all() && !it->mission) continue;
      out.push_back(*it);
    }
  }
  if (!sites.all()) {
    std::erase_if(out, [&](const LiveEvent& event) { return !sites.holds(hub_.site_of(*event.mission)); });
    if (out.size() > limit) out.resize(limit);
  }
  return out;
}

}  // namespace anchord::api
