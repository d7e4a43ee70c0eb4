#pragma once

#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/ports/devices.hpp"

namespace anchord::api {

nlohmann::ordered_json device_json(const DeviceReport& device);
/// Its row of topic `devices`: live, late or lost as for a radio that is heard, and the supervisor's phase.
nlohmann::ordered_json device_row_json(const DeviceReport& device);
nlohmann::ordered_json discovered_json(const DiscoveredDevice& found);
nlohmann::ordered_json clock_json(const DeviceClock& clock);

/// Body of POST /devices (`whole`) and merge-patch of PATCH. `options: null` and members of it that are null
/// are taken out.
void patch_device(const nlohmann::json& body, bool whole, DeviceConfig& device,
                  std::vector<FieldError>& errors);

}  // namespace anchord::api
