#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "api/admin/alarm_rules.hpp"
#include "core/base/ids.hpp"
#include "core/base/locked.hpp"
#include "core/base/result.hpp"
#include "core/types/mission.hpp"

namespace anchord {
class DeviceControl;
class MissionStore;
class ServiceStore;
}  // namespace anchord

namespace anchord::api {

class EventLog;

/// Which mission has the rows of this server's devices.
///
/// The devices are one kit's and follow its flight: the first mission that records has them until it ends,
/// and no other gets them by being created. Taking them is asked for by name, is an event and an alarm on
/// both missions, and is undone when the taker ends. Kept over a restart. Thread-safe.
class DeviceStream {
 public:
  struct Deps {
    DeviceControl& devices;
    ServiceStore& store;
    MissionStore& missions;
    EventLog& events;
  };
  explicit DeviceStream(Deps deps) : deps_(deps) {}

  struct Holder {
    MissionId id{};
    std::string name;
  };
  /// Gives the devices to a new mission when nobody has them; else says who has.
  std::optional<Holder> begin(const Mission& mission);
  /// Takes them from whoever has them; who that was.
  std::optional<Holder> take(const Mission& mission, const std::string& by);
  /// A mission ended: what it had goes back to the one it was taken from.
  void ended(const MissionId& mission);
  std::optional<Holder> holder() const;
  /// After a restart: goes on with what was being recorded.
  void resume();
  /// A mission whose devices record into another, and the one that has them.
  std::vector<AlarmCondition> alarms() const;

 private:
  void change(std::vector<Holder> next);

  const Deps deps_;
  /// One change at a time, while the devices and the disk are told; taken before stack_, which readers
  /// (alarms) take alone: they must not wait for the disk.
  std::mutex changing_;
  Locked<std::vector<Holder>> stack_;  ///< the last one has them, those before get them back
};

}  // namespace anchord::api
