#include "api/admin/alarm_board.hpp"

#include <algorithm>
#include <tuple>

#include "api/admin/event_log.hpp"
#include "api/wire/live_writer.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

EventLevel level_of(AlarmPriority priority) {
  switch (priority) {
    case AlarmPriority::critical:
      return EventLevel::critical;
    case AlarmPriority::warning:
      return EventLevel::warning;
    case AlarmPriority::advisory:
      return EventLevel::info;
  }
  return EventLevel::info;
}

}  // namespace

std::string alarm_json(const Alarm& alarm) {
  const auto& c = alarm.condition;
  return R"({"id":)" + json_text(c.id) + R"(,"priority":")" +
         std::string(k_alarm_priority_words.word(c.priority)) + R"(","since_us":)" +
         std::to_string(alarm.since.us()) + R"(,"text":)" + json_text(c.text) + R"(,"mission":)" +
         (c.mission ? json_text(to_string(*c.mission)) : "null") + R"(,"acknowledged":)" +
         (alarm.acknowledged ? "true}" : "false}");
}

bool concerns(const Alarm& alarm, const std::optional<SiteId>& site, const SiteSet& sites) {
  const auto& c = alarm.condition;
  return c.mission ? sites.holds(site) : sites.all() || !c.of_sites;
}

void AlarmBoard::update(std::vector<AlarmCondition> holding, UtcTime now) {
  std::vector<AlarmCondition> raised, cleared;
  {
    auto alarms = alarms_.lock();
    std::vector<Alarm> next;
    for (auto& condition : holding) {
      const auto before = std::ranges::find_if(
          *alarms, [&](const Alarm& a) { return a.condition.is(condition.id, condition.mission); });
      Alarm alarm{std::move(condition), now, false};
      if (before == alarms->end()) {
        raised.push_back(alarm.condition);
      } else {
        alarm.since = before->since;
        // What got worse must speak again.
        alarm.acknowledged = before->acknowledged && alarm.condition.text == before->condition.text;
      }
      next.push_back(std::move(alarm));
    }
    for (const auto& alarm : *alarms) {
      const auto& was = alarm.condition;
      if (std::ranges::none_of(next, [&](const Alarm& a) { return a.condition.is(was.id, was.mission); }))
        cleared.push_back(was);
    }
    std::ranges::stable_sort(next, {},
                             [](const Alarm& a) { return std::tuple(a.condition.priority, a.since); });
    *alarms = std::move(next);
  }
  for (const auto& c : raised)
    events_.add(level_of(c.priority), "alarm.raised", c.id + ": " + c.text, c.mission);
  for (const auto& c : cleared) events_.add(EventLevel::info, "alarm.cleared", c.id + " is over", c.mission);
}

Result<Alarm> AlarmBoard::acknowledge(std::string_view id, const std::optional<MissionId>& mission,
                                      std::string_view by) {
  Alarm found;
  {
    auto alarms = alarms_.lock();
    const auto at =
        std::ranges::find_if(*alarms, [&](const Alarm& a) { return a.condition.is(id, mission); });
    if (at == alarms->end())
      return make_error(Errc::not_found, "there is no active alarm " + to_utf8(id, 60));
    if (at->acknowledged) return *at;
    at->acknowledged = true;
    found = *at;
  }
  events_.add(EventLevel::info, "alarm.acknowledged",
              found.condition.id + " acknowledged by " + std::string(by), found.condition.mission);
  return found;
}

std::vector<Alarm> AlarmBoard::standing() const { return alarms_.copy(); }

}  // namespace anchord::api
