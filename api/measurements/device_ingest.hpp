#pragma once

#include "core/ports/devices.hpp"

namespace anchord {
class MeasurementStore;
}

namespace anchord::api {

class MissionService;

/// Rows of our own devices on the way that uploads take: to the live flight as they come, then into the
/// store. Thread-safe.
class DeviceIngest final : public DeviceRows {
 public:
  DeviceIngest(MeasurementStore& store, MissionService& missions) : store_(store), missions_(missions) {}
  void live(const DeviceBatch& batch) override;
  Result<void> store(const DeviceBatch& batch) override;

 private:
  MeasurementStore& store_;
  MissionService& missions_;
};

}  // namespace anchord::api
