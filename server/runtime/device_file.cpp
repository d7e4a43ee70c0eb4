#include "server/runtime/device_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::server {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

Result<std::vector<DeviceConfig>> read_devices(const fs::path& file) {
  std::vector<DeviceConfig> out;
  std::error_code error;
  if (!fs::exists(file, error)) return out;
  std::ifstream in(file, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  if (!in && !in.eof()) return make_error(Errc::storage_unavailable, file.string() + " cannot be read");
  const auto bad = [&](const std::string& why) {
    return make_error(Errc::bad_frame, file.string() + ": " + why);
  };
  const auto json = Json::parse(text, nullptr, false);
  if (!json.is_object() || json.value("schema", "") != "anchord.devices/1" || !json.contains("devices") ||
      !json["devices"].is_array()) {
    return bad("not a list of devices (anchord.devices/1)");
  }
  for (const auto& item : json["devices"]) {
    if (!item.is_object()) return bad("a device is an object");
    const auto word = [&](const char* key) {
      const auto it = item.find(key);
      return it != item.end() && it->is_string() ? it->get<std::string>() : std::string();
    };
    DeviceConfig device;
    BOOST_OUTCOME_TRY(device.id, parse_uuid(word("id")));
    device.kind = word("kind");
    device.name = word("name");
    device.address = word("address");
    if (const auto it = item.find("options"); it != item.end() && it->is_object())
      device.options_json = to_wire(*it);
    if (const auto it = item.find("enabled"); it != item.end() && it->is_boolean())
      device.enabled = it->get<bool>();
    if (const auto it = item.find("version"); it != item.end() && it->is_number_unsigned()) {
      device.version = it->get<std::uint64_t>();
    }
    out.push_back(std::move(device));
  }
  return out;
}

Result<void> write_devices(const fs::path& file, const std::vector<DeviceConfig>& devices) {
  Json list = Json::array();
  for (const auto& d : devices) {
    list.push_back({{"id", to_string(d.id)},
                    {"kind", d.kind},
                    {"name", d.name},
                    {"address", d.address},
                    {"options", Json::parse(d.options_json, nullptr, false)},
                    {"enabled", d.enabled},
                    {"version", d.version}});
  }
  const auto text = to_wire(Json{{"schema", "anchord.devices/1"}, {"devices", std::move(list)}}, 1) + "\n";
  const fs::path part = file.string() + ".part";
  const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const bool written = fd >= 0 &&
                       ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       ::fsync(fd) == 0;
  const int failure = errno;
  if (fd >= 0) ::close(fd);
  std::error_code error;
  if (written) fs::rename(part, file, error);
  if (!written || error) {
    return make_error(failure == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
                      "cannot write " + file.string() + ": " + std::strerror(failure));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::server
