#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "core/base/result.hpp"
#include "core/ports/broker.hpp"

namespace anchord::server {

struct MqttOptions {
  std::string host;
  std::uint16_t port{1883};
  std::string ca_file;  ///< empty: no TLS
  std::string user, password;
  std::chrono::milliseconds period{500};        ///< between two looks at the source: at most 2 Hz a topic
  std::chrono::milliseconds answer{10'000};     ///< from connecting to the broker's word
  std::chrono::milliseconds first_wait{1'000};  ///< after a loss; doubles with each failure
  std::chrono::milliseconds longest_wait{60'000};
  std::chrono::seconds keep_alive{15};  ///< a broker that is silent for longer than 1.5 of it is lost
};

/// Publishes through libmosquitto (MQTT 3.1.1) on a thread of its own, `anchord-mqtt`. TLS 1.2 or newer, with
/// the broker's name and certificate checked. Errors: invalid_argument (a file of certificates that cannot be
/// used).
Result<std::unique_ptr<Broker>> make_mqtt_broker(MqttOptions options);

/// The first line of a file that nobody else may read. errors: not_found, invalid_argument
Result<std::string> read_mqtt_password(const std::string& file);

}  // namespace anchord::server
