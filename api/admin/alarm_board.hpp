#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/base/site_set.hpp"

namespace anchord::api {

class EventLog;

/// An alarm that stands.
struct Alarm {
  AlarmCondition condition;
  UtcTime since{};
  bool acknowledged{false};
};
/// As topic `alarms` and GET /alarms show it.
std::string alarm_json(const Alarm& alarm);
/// Whether it concerns who sees these sites: what is of the whole server (disk, link, devices) concerns all
/// who fly. `site`: of its mission.
bool concerns(const Alarm& alarm, const std::optional<SiteId>& site, const SiteSet& sites);

/// The alarms that stand, one for each id and mission: raised when their condition begins, gone when it ends,
/// quiet but visible once acknowledged. Raising, clearing and acknowledging are events. Thread-safe.
class AlarmBoard {
 public:
  explicit AlarmBoard(EventLog& events) : events_(events) {}
  /// What holds now, about once a second.
  void update(std::vector<AlarmCondition> holding, UtcTime now);
  /// The alarm of this id and mission (absent: of the server). Errors: not_found when no such alarm stands.
  /// Acknowledging twice is no error.
  Result<Alarm> acknowledge(std::string_view id, const std::optional<MissionId>& mission,
                            std::string_view by);
  /// By priority, then time.
  std::vector<Alarm> standing() const;

 private:
  EventLog& events_;
  Locked<std::vector<Alarm>> alarms_;
};

}  // namespace anchord::api
