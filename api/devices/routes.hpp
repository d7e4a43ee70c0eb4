#pragma once

#include "api/kit/audit.hpp"

namespace anchord {
class DeviceControl;
class MeasurementStore;
}  // namespace anchord

namespace anchord::api {

class DeviceStream;
class JobService;
class Router;

/// What the routes of devices work with; lives as long as the router.
struct DeviceApi {
  DeviceControl& devices;
  MeasurementStore& measurements;
  DeviceStream& stream;
  JobService& jobs;
  Audit audit;
};

void add_device_routes(Router& router, DeviceApi& api);

}  // namespace anchord::api
