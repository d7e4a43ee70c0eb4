#include "api/admin/event_log.hpp"

#include <algorithm>

#include "api/stream/hub.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"

namespace anchord::api {

std::string event_json(const LiveEvent& event) {
  return R"({"id":")" + to_string(event.id) + R"(","t_us":)" + std::to_string(event.time.us()) +
         R"(,"level":)" + json_text(to_string(event.level)) + R"(,"code":)" + json_text(event.code) +
         R"(,"text":)" + json_text(event.text) + R"(,"mission":)" +
         (event.mission ? json_text(to_string(*event.mission)) : "null") + '}';
}

void EventLog::add(EventLevel level, std::string code, std::string text, std::optional<MissionId> mission) {
  const UtcTime now = clock_.now();
  const LiveEvent event{make_uuid_v7(now), now, level, std::move(code), std::move(text), mission};
  std::string json = event_json(event);
  {
    auto kept = events_.lock();
    kept->push_back(event);
    if (kept->size() > k_kept) kept->pop_front();
  }
  hub_.publish(Topic::events, std::move(json), now.us());
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
  std::vector<LiveEvent> out;
  const auto kept = events_.lock();
  for (auto it = kept->rbegin(); it != kept->rend() && out.size() < limit; ++it) {
    if (mission && it->mission != mission) continue;
    if (since && it->time < *since) continue;  // not in order of time where the clock was set back
    out.push_back(*it);
  }
  return out;
}

}  // namespace anchord::api
