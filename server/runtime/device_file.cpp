#include "server/runtime/device_file.hpp"

#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"

namespace anchord::server {

namespace fs = std::filesystem;
using Ordered = nlohmann::ordered_json;
constexpr std::string_view k_replacement = "\xef\xbf\xbd";  // U+FFFD, what to_utf8 leaves

namespace {

std::string word(const Ordered& item, const char* key) {
  const auto it = item.find(key);
  return it != item.end() && it->is_string() ? it->get<std::string>() : std::string();
}

/// What in an entry cannot be what somebody set up; empty: nothing. Whether a driver takes its settings is
/// seen when it is started.
std::string fault_of(const Ordered& item) {
  if (!item.is_object()) return "the entry is not an object";
  if (!parse_uuid(word(item, "id"))) return "id: not a UUID";
  for (const char* key : {"kind", "name", "address"}) {
    if (!item.contains(key) || !item[key].is_string()) return std::string(key) + ": not a string";
  }
  if (item.contains("options") && !item["options"].is_object()) return "options: not an object";
  if (item.contains("enabled") && !item["enabled"].is_boolean()) return "enabled: not true or false";
  if (item.contains("version") && !item["version"].is_number_unsigned()) return "version: not a number";
  for (const char* key : {"kind", "address", "options"}) {
    if (item.contains(key) && to_wire(item[key]).find(k_replacement) != std::string::npos)
      return std::string(key) + ": holds bytes that are not UTF-8";
  }
  return {};
}

KeptDevice device_of(const Ordered& item) {
  KeptDevice out;
  out.problem = fault_of(item);
  if (item.is_object()) {
    const auto id = parse_uuid(word(item, "id"));
    out.config.id = id ? id.value() : Uuid{};
    out.config.kind = word(item, "kind");
    out.config.name = word(item, "name");
    out.config.address = word(item, "address");
    if (const auto it = item.find("options"); it != item.end() && it->is_object())
      out.config.options = {to_wire(*it)};
    if (const auto it = item.find("enabled"); it != item.end() && it->is_boolean())
      out.config.enabled = it->get<bool>();
    if (const auto it = item.find("version"); it != item.end() && it->is_number_unsigned())
      out.config.version = it->get<std::uint64_t>();
  }
  if (!out.problem.empty()) out.entry_json = to_wire(item);
  return out;
}

}  // namespace

KeptDevices read_devices(const fs::path& file) {
  KeptDevices out;
  std::error_code error;
  if (!fs::exists(file, error) && !error) return out;
  const auto bad = [&](const std::string& why) {
    out.problem = to_utf8(file.string()) + ": " + why;
    return out;
  };
  std::ifstream in(file, std::ios::binary);
  if (!in) return bad(std::string("cannot be read: ") + std::strerror(errno));
  const std::string text(std::istreambuf_iterator<char>(in), {});
  if (in.bad()) return bad("cannot be read to its end");
  // Bytes that are no text spoil the entry that has them, not the others.
  const auto json = Ordered::parse(to_utf8(text), nullptr, false);
  if (!json.is_object() || word(json, "schema") != "anchord.devices/1" || !json.contains("devices") ||
      !json["devices"].is_array()) {
    return bad("not a list of devices (anchord.devices/1)");
  }
  std::set<Uuid> seen;
  for (const auto& item : json["devices"]) {
    auto device = device_of(item);
    if (device.problem.empty() && !seen.insert(device.config.id).second) {
      device.problem = "id: another entry has the same";
      device.entry_json = to_wire(item);
    }
    // A name for as long as this server runs: by it the entry can be seen, mended and removed.
    if (!device.problem.empty() && !seen.insert(device.config.id).second) device.config.id = Uuid{};
    if (device.config.id == Uuid{}) device.config.id = make_uuid_v7(SystemClock{}.now());
    out.devices.push_back(std::move(device));
  }
  return out;
}

Result<void> keep_unreadable(const fs::path& file) {
  std::error_code error;
  for (int n = 1; n < 1000; ++n) {
    const fs::path aside = file.string() + ".unreadable-" + std::to_string(n);
    if (fs::exists(aside, error)) continue;
    fs::copy_file(file, aside, error);
    if (!error) return boost::outcome_v2::success();
    break;
  }
  return make_error(Errc::storage_unavailable, "cannot store a copy of " + file.string() +
                                                   ", so it is not replaced: " + error.message());
}

Result<void> write_devices(const fs::path& file, const std::vector<KeptDevice>& devices) {
  Ordered list = Ordered::array();
  for (const auto& kept : devices) {
    const auto& d = kept.config;
    if (!kept.entry_json.empty()) {
      list.push_back(Ordered::parse(kept.entry_json, nullptr, false));
      continue;
    }
    list.push_back({{"id", to_string(d.id)},
                    {"kind", d.kind},
                    {"name", d.name},
                    {"address", d.address},
                    {"options", Ordered::parse(d.options.text, nullptr, false)},
                    {"enabled", d.enabled},
                    {"version", d.version}});
  }
  return write_private(
      file, to_wire(Ordered{{"schema", "anchord.devices/1"}, {"devices", std::move(list)}}, 1) + "\n");
}

}  // namespace anchord::server
