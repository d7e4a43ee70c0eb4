#include "server/runtime/device_file.hpp"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"

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
  return write_private(
      file, to_wire(Json{{"schema", "anchord.devices/1"}, {"devices", std::move(list)}}, 1) + "\n");
}

}  // namespace anchord::server
