#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/ports/devices.hpp"

namespace anchord::server {

/// What Prometheus reads of the devices, a family for each counter; nothing where there are none.
std::string device_metrics(const std::vector<DeviceReport>& all, std::uint64_t rows_lost);

}  // namespace anchord::server
