#include "api/services/alarm_board.hpp"

#include "api/json/live_writer.hpp"
#include "api/services/event_log.hpp"

namespace anchord::api {

void AlarmBoard::set(const Alarm& alarm, const std::string& why, UtcTime now) {
  const auto found = standing_.find(alarm.id);
  const std::string id(alarm.id), level(alarm.priority == "advisory" ? "info" : alarm.priority);
  if (!why.empty()) {
    if (found != standing_.end()) {
      found->second.text = why;  // numbers in it change; that is no news
      return;
    }
    standing_[id] = {std::string(alarm.priority), why, now};
    events_.add(level, id, why);
  } else if (found != standing_.end()) {
    standing_.erase(found);
    events_.add("info", id + ".over", std::string(alarm.over));
  }
}

std::string AlarmBoard::json() const {
  std::string out = "[";
  for (const auto& [id, alarm] : standing_) {
    out += (out.size() > 1 ? "," : "") + std::string(R"({"id":)") + json_text(id) + R"(,"priority":)" +
           json_text(alarm.priority) + R"(,"since_us":)" + std::to_string(alarm.since.us()) + R"(,"text":)" +
           json_text(alarm.text) + R"(,"acknowledged":false})";
  }
  return out + ']';
}

}  // namespace anchord::api
