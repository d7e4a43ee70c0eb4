#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/ports/devices.hpp"

namespace anchord::server {

/// An entry of `devices.json`, usable or not.
struct KeptDevice {
  DeviceConfig config;     ///< as far as it can be read; its id is made up where the entry has none
  std::string problem;     ///< why it is not started, one line; empty: it can be
  std::string entry_json;  ///< what cannot be read, to be written back as it stands
};

struct KeptDevices {
  std::vector<KeptDevice> devices;
  std::string problem;  ///< of the file as a whole: it names no device that could be read
};

/// `devices.json` of the data folder, docs/formats.md. An absent file is no devices. Nothing in it keeps the
/// server from starting: what cannot be read says why, and stays in the file.
KeptDevices read_devices(const std::filesystem::path& file);
/// Whole or not at all, for the owner alone.
Result<void> write_devices(const std::filesystem::path& file, const std::vector<KeptDevice>& devices);
/// A copy beside it, `devices.json.unreadable-1` and so on, before a file that could not be read is replaced.
Result<void> keep_unreadable(const std::filesystem::path& file);

}  // namespace anchord::server
