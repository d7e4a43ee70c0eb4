#pragma once

#include <filesystem>
#include <vector>

#include "core/base/result.hpp"
#include "core/ports/devices.hpp"

namespace anchord::server {

/// `devices.json` of the data folder, docs/formats.md. An absent file is no devices. errors: bad_frame,
/// storage_unavailable.
Result<std::vector<DeviceConfig>> read_devices(const std::filesystem::path& file);
/// Whole or not at all, for the owner alone.
Result<void> write_devices(const std::filesystem::path& file, const std::vector<DeviceConfig>& devices);

}  // namespace anchord::server
