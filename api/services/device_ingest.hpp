#pragma once

#include "core/ports/devices.hpp"

namespace anchord {
class MeasurementStore;
}

namespace anchord::api {

class MissionService;

/// Rows of our own devices on the way that uploads take: stored, and once committed to the live flight.
/// Thread-safe; blocks on the database.
class DeviceIngest final : public DeviceRows {
 public:
  DeviceIngest(MeasurementStore& store, MissionService& missions) : store_(store), missions_(missions) {}
  Result<void> take(std::vector<Fix> fixes, std::vector<Range> ranges) override;

 private:
  MeasurementStore& store_;
  MissionService& missions_;
};

}  // namespace anchord::api
