#include "server/app/startup.hpp"

#include "api/mqtt/topic_name.hpp"
#include "drivers/link/address.hpp"
#include "server/app/proxies.hpp"
#include "server/config/listeners.hpp"
#include "server/http/http_server.hpp"
#include "server/runtime/device_manager.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::server {

/// Whoever can reach the aircraft's link can fly it, unless frames are signed.
Result<std::optional<DroneEnd>> drone_end(const Config& config) {
  const auto& address = config.text("drone.address");
  if (address.empty()) return std::nullopt;
  DroneEnd out{address};
  if (const auto& file = config.text("drone.signing_key_file"); !file.empty()) {
    auto read = drone::read_signing_key(file);
    if (!read) return make_error(read.error().code, "drone.signing_key_file: " + read.error().message);
    out.key = read.value();
  }
  const auto where = link::parse_address(address);
  if (!where) return make_error(where.error().code, "drone.address: " + where.error().message);
  if (link::others_may_reach(where.value()) && !out.key && !config.flag("insecure")) {
    return make_error(Errc::invalid_argument,
                      "drone.address " + address +
                          " can be reached from other machines, which could fly the aircraft; give "
                          "--drone-signing-key-file (MAVLink 2 signing), or accept this with --insecure");
  }
  return out;
}

/// A password must not pass a network that others may be on in the clear.
Result<std::optional<MqttOptions>> mqtt_options(const Config& config) {
  const auto bad = [](std::string_view key, const std::string& why) {
    return make_error(Errc::invalid_argument, std::string(key) + ": " + why);
  };
  MqttOptions options;
  options.host = config.text("mqtt.host");
  if (options.host.empty()) return std::nullopt;
  const auto port = config.count("mqtt.port");
  if (port > 65'535) return bad("mqtt.port", std::to_string(port) + " is above 65535");
  options.port = static_cast<std::uint16_t>(port);
  if (const auto wrong = api::wrong_prefix(config.text("mqtt.prefix")); !wrong.empty())
    return bad("mqtt.prefix", wrong);
  options.ca_file = config.text("mqtt.ca_file");
  options.user = config.text("mqtt.user");
  if (const auto& file = config.text("mqtt.password_file"); !file.empty()) {
    if (options.user.empty()) return bad("mqtt.password_file", "a password needs mqtt.user");
    auto password = read_mqtt_password(file);
    if (!password) return bad("mqtt.password_file", password.error().message);
    options.password = std::move(password).value();
    const bool v6 = options.host.find(':') != std::string::npos;
    const auto local =
        is_loopback((v6 ? '[' + options.host + ']' : options.host) + ':' + std::to_string(port));
    if (options.ca_file.empty() && !(local && local.value()) && !config.flag("insecure"))
      return bad("mqtt.password_file",
                 "the password would go to " + options.host +
                     " unencrypted; set mqtt.ca_file (TLS), or accept this with --insecure");
  }
  return options;
}

Result<void> check_startup(const Config& config) {
  BOOST_OUTCOME_TRY(const auto listeners, listeners_of(config));
  BOOST_OUTCOME_TRYV(check_listeners(config, listeners));
  if (!config.text("tls.certificate").empty()) {
    BOOST_OUTCOME_TRYV(TlsKeeper::open({config.text("tls.certificate"), config.text("tls.key")}));
  }
  BOOST_OUTCOME_TRYV(TrustedProxies::parse(config.list("trusted_proxies")));
  if (config.flag("standby") && config.text("database").empty())
    return make_error(Errc::invalid_argument,
                      "standby: a folder has one server; give --database, which several can reach");
  for (const auto& text : config.list("devices")) {
    BOOST_OUTCOME_TRYV(parse_device_setting(text));
  }
  BOOST_OUTCOME_TRYV(drone_end(config));
  BOOST_OUTCOME_TRYV(mqtt_options(config));
  return boost::outcome_v2::success();
}

}  // namespace anchord::server
