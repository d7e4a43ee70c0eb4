#include "server/runtime/device_secrets.hpp"

#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"
#include "server/runtime/private_file.hpp"

namespace anchord::server {

namespace fs = std::filesystem;
using Json = nlohmann::json;

namespace {

/// Of options that are kept: what is no object, or no word of ours, has none.
bool password_set(const Json& options) {
  if (!options.is_object()) return false;
  const auto it = options.find("password_set");
  return it != options.end() && it->is_boolean() && it->get<bool>();
}

}  // namespace

Result<DeviceSecrets::Change> DeviceSecrets::split(DeviceConfig config, const DeviceConfig* before) {
  Change change;
  auto options = Json::parse(config.options.text, nullptr, false);
  if (!options.is_object()) options = Json::object();
  const auto had = before != nullptr ? Json::parse(before->options.text, nullptr, false) : Json::object();
  bool set = password_set(had);
  if (const auto given = options.find("password"); given != options.end() && given->is_string()) {
    change.given = true;
    change.password = given->get<std::string>();
    set = !change.password.empty();
  } else if (set && (before->address != config.address || before->kind != config.kind)) {
    return make_error(Errc::invalid_argument,
                      "password: the stored one belongs to " + before->address +
                          "; send the password again with the new address, or an empty one");
  }
  options.erase("password");
  options.erase("password_set");
  if (set) options["password_set"] = true;
  config.options = {to_wire(options)};
  change.config = std::move(config);
  return change;
}

Result<void> DeviceSecrets::store(const Change& change) const {
  if (!change.given) return boost::outcome_v2::success();
  if (change.password.empty()) {
    forget(change.config.id);
    return boost::outcome_v2::success();
  }
  std::error_code error;
  fs::create_directories(folder_, error);
  if (!error) fs::permissions(folder_, fs::perms::owner_all, error);
  if (error)
    return make_error(Errc::storage_unavailable, "cannot make " + folder_.string() + ": " + error.message());
  return write_private(file(change.config.id), change.password + "\n");
}

void DeviceSecrets::forget(const Uuid& id) const {
  std::error_code none;
  fs::remove(file(id), none);
}

std::string DeviceSecrets::kept(const Uuid& id) const {
  std::ifstream in(file(id));
  std::string line;
  std::getline(in, line);
  return line;
}

void DeviceSecrets::put_back(const Uuid& id, const std::string& password) const {
  Change change;
  change.config.id = id;
  change.given = true;
  change.password = password;
  (void)store(change).has_value();
}

std::string DeviceSecrets::driver_options(const DeviceConfig& config) const {
  auto options = Json::parse(config.options.text, nullptr, false);
  if (!options.is_object() || !options.contains("password_set")) return config.options.text;
  const bool set = password_set(options);
  options.erase("password_set");
  if (set) options["password_file"] = file(config.id).string();
  return to_wire(options);
}

bool DeviceSecrets::drop_password_file(DeviceConfig& config) {
  auto options = Json::parse(config.options.text, nullptr, false);
  if (!options.is_object() || options.erase("password_file") == 0) return false;
  config.options = {to_wire(options)};
  return true;
}

}  // namespace anchord::server
