#pragma once

#include <map>
#include <string>
#include <string_view>

#include "core/base/time.hpp"

namespace anchord::api {

class EventLog;

/// The alarms that stand, by id: each is told once as an event when it comes and once when it goes, and is in
/// the list of topic `alarms` in between. Not thread-safe.
class AlarmBoard {
 public:
  struct Alarm {
    std::string_view id, priority;  ///< of topic `alarms`: critical, warning, advisory
    std::string_view over;          ///< what the event says when it is over
  };
  explicit AlarmBoard(EventLog& events) : events_(events) {}
  /// why  what is wrong now, one line; empty: nothing is
  void set(const Alarm& alarm, const std::string& why, UtcTime now);
  /// JSON array, the data of topic `alarms`.
  std::string json() const;

 private:
  struct Standing {
    std::string priority, text;
    UtcTime since{};
  };
  EventLog& events_;
  std::map<std::string, Standing, std::less<>> standing_;
};

}  // namespace anchord::api
