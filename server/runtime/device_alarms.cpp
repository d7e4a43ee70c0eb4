#include "server/runtime/device_alarms.hpp"

#include <algorithm>

#include "core/base/text.hpp"

namespace anchord::server {

namespace {

/// Each device of which something is said, with what is said.
std::string by_device(const std::vector<device::DeviceState>& devices,
                      std::string device::DeviceState::*said) {
  std::string out;
  for (const auto& s : devices) {
    if ((s.*said).empty()) continue;
    out += (out.empty() ? "device \"" : "; device \"") + s.settings.name + "\": " + s.*said;
  }
  return out;
}

}  // namespace

std::string too_many_ids(const std::vector<device::DeviceState>& devices) {
  return by_device(devices, &device::DeviceState::too_many_ids);
}

std::string moved_bases(const std::vector<device::DeviceState>& devices) {
  return by_device(devices, &device::DeviceState::moved_base);
}

std::string unused_sources(const std::vector<device::DeviceState>& devices) {
  return by_device(devices, &device::DeviceState::unused);
}

std::string recordings_on_disk(const std::filesystem::path& folder,
                               const std::vector<device::DeviceState>& devices) {
  std::error_code error;
  std::uint64_t bytes = 0;
  for (std::filesystem::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;
    if (const auto size = it->file_size(gone); !gone) bytes += size;
  }
  const std::uint64_t gib = bytes >> 30;
  if (gib == 0) return {};
  std::string out =
      "raw recordings take more than " + std::to_string(gib) + " GiB of it in " + to_utf8(folder.string());
  const auto most = std::ranges::max_element(devices, {}, &device::DeviceState::recorded);
  if (most != devices.end() && most->recorded > 0)
    out += ", and device \"" + most->settings.name + "\" has written most since the start";
  return out;
}

}  // namespace anchord::server
