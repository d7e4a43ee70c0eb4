#include "api/devices/device_stream.hpp"

#include <algorithm>

#include "api/admin/event_log.hpp"
#include "core/ports/devices.hpp"
#include "core/ports/mission_bin.hpp"
#include "core/ports/mission_store.hpp"

namespace anchord::api {

/// With changing_ held.
void DeviceStream::change(std::vector<Holder> next) {
  const auto now = next.empty() ? std::nullopt : std::optional(next.back().id);
  std::vector<MissionId> ids;
  for (const auto& one : next) ids.push_back(one.id);
  (void)stack_.exchange(std::move(next));
  if (deps_.devices.recording_into() != now) deps_.devices.record_into(now);
  if (const auto kept = deps_.store.keep_device_stream(ids); !kept) {
    deps_.events.add(
        EventLevel::warning, "devices.not_kept",
        "after a restart the server would not know which mission has the devices: " + kept.error().message,
        now);
  }
}

std::optional<DeviceStream::Holder> DeviceStream::begin(const Mission& mission) {
  const std::scoped_lock changing(changing_);
  const auto before = holder();
  if (!before) {
    change({{mission.id, mission.name}});
    return std::nullopt;
  }
  if (before->id == mission.id) return std::nullopt;
  if (!deps_.devices.devices().empty()) {
    deps_.events.add(
        EventLevel::warning, "devices.held",
        mission.name + " gets no measurements of the devices: " + before->name + " is recording with them",
        mission.id);
  }
  return before;
}

std::optional<DeviceStream::Holder> DeviceStream::take(const Mission& mission, const std::string& by) {
  const std::scoped_lock changing(changing_);
  const auto before = holder();
  if (before && before->id == mission.id) return std::nullopt;
  auto next = stack_.copy();
  std::erase_if(next, [&](const Holder& one) { return one.id == mission.id; });
  next.push_back({mission.id, mission.name});
  change(std::move(next));
  if (before) {
    deps_.events.add(EventLevel::critical, "devices.lost",
                     by + " gave the devices of " + before->name + " to " + mission.name +
                         "; they are given back when that mission ends",
                     before->id);
    deps_.events.add(EventLevel::warning, "devices.taken",
                     mission.name + " took the devices of " + before->name, mission.id);
  }
  return before;
}

void DeviceStream::ended(const MissionId& mission) {
  const std::scoped_lock changing(changing_);
  const auto before = holder();
  auto next = stack_.copy();
  if (std::erase_if(next, [&](const Holder& one) { return one.id == mission; }) == 0) return;
  change(std::move(next));
  const auto now = holder();
  if (before->id == mission && now)
    deps_.events.add(EventLevel::warning, "devices.returned", now->name + " has its devices back", now->id);
}

std::optional<DeviceStream::Holder> DeviceStream::holder() const {
  const auto stack = stack_.lock();
  return stack->empty() ? std::nullopt : std::optional(stack->back());
}

void DeviceStream::resume() {
  const auto kept = deps_.store.device_stream();
  if (!kept) {
    deps_.events.add(EventLevel::critical, "devices.not_resumed",
                     "the mission that the devices recorded into before the restart cannot be read: " +
                         kept.error().message,
                     {});
    return;
  }
  const std::scoped_lock changing(changing_);
  std::vector<Holder> next;
  for (const auto& id : kept.value()) {
    const auto mission = deps_.missions.mission(id);
    if (mission && mission.value().state == MissionState::recording)
      next.push_back({id, mission.value().name});
  }
  change(std::move(next));
  if (const auto now = holder()) {
    deps_.events.add(EventLevel::info, "devices.resumed",
                     "the devices continue recording into " + now->name + " after the restart", now->id);
  }
}

std::vector<AlarmCondition> DeviceStream::alarms() const {
  Holder has, lost;
  {
    const auto stack = stack_.lock();
    if (stack->size() < 2) return {};
    has = stack->back();
    lost = (*stack)[stack->size() - 2];
  }
  if (deps_.devices.devices().empty()) return {};  // nobody misses rows that there are none of
  return {
      {"devices.lost", AlarmPriority::critical,
       lost.name + ": its devices record into " + has.name + "; they are given back when that mission ends",
       lost.id},
      {"devices.taken", AlarmPriority::warning, has.name + " has the devices of " + lost.name, has.id}};
}

}  // namespace anchord::api
