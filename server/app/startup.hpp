#pragma once

#include <optional>
#include <string>

#include "core/base/result.hpp"
#include "drivers/drone/signing_key.hpp"
#include "server/config/config.hpp"
#include "server/mqtt/mqtt_broker.hpp"

namespace anchord::server {

/// Where the aircraft's link is, and how its frames are signed.
struct DroneEnd {
  std::string address;
  std::optional<mavlink::Secret> key{};  ///< absent: they are not
};

/// Of the settings drone.*; absent: there is no link. errors: invalid_argument (which setting, and what to
/// do), not_found (the file of the key)
Result<std::optional<DroneEnd>> drone_end(const Config& config);

/// Of the settings mqtt.*; absent: there is no broker. errors: invalid_argument
Result<std::optional<MqttOptions>> mqtt_options(const Config& config);

/// Whatever of settings that are well written would keep the server from starting, as far as it can be known
/// without making or opening anything: files that they name, what others could reach, what belongs together.
Result<void> check_startup(const Config& config);

}  // namespace anchord::server
