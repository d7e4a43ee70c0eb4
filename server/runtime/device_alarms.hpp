#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "drivers/device/device_loop.hpp"

namespace anchord::server {

/// Devices that send more ids than a flight follows, one line; empty: none.
std::string too_many_ids(const std::vector<device::DeviceState>& devices);
std::string unused_sources(const std::vector<device::DeviceState>& devices);

/// Devices whose base of corrections moved or changed in this flight, one line; empty: none.
std::string moved_bases(const std::vector<device::DeviceState>& devices);

/// What the raw recordings in `folder` take of the disk and which device writes most of them, one line;
/// empty: less than a GiB, not worth moving.
std::string recordings_on_disk(const std::filesystem::path& folder,
                               const std::vector<device::DeviceState>& devices);

}  // namespace anchord::server
