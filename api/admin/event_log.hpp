#pragma once

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/time.hpp"
#include "core/types/live_event.hpp"

namespace anchord::api {

class Hub;

/// As the wire has it: id, t_us, level, code, text, mission, place.
std::string event_json(const LiveEvent& event);

/// The last 10 000 events, also published on topic `events`. Thread-safe.
class EventLog {
 public:
  static constexpr std::size_t k_kept = 10'000;
  EventLog(Hub& hub, const Clock& clock) : hub_(hub), clock_(clock) {}
  /// Who is told of every event beside the stream, on the thread that adds it; set once, before the threads.
  void on_event(std::function<void(const LiveEvent&)> tell) { tell_ = std::move(tell); }
  void add(EventLevel level, std::string code, std::string text, std::optional<MissionId> mission = {},
           std::optional<EventPlace> place = {});
  /// Puts events of before the start in front of all others, oldest first; nobody is told again.
  void restore(const std::vector<LiveEvent>& events);
  /// Newest first.
  std::vector<LiveEvent> newest(std::size_t limit, const std::optional<MissionId>& mission,
                                std::optional<UtcTime> since) const;

 private:
  Hub& hub_;
  const Clock& clock_;
  std::function<void(const LiveEvent&)> tell_{[](const LiveEvent&) {}};
  Locked<std::deque<LiveEvent>> events_;
};

}  // namespace anchord::api
