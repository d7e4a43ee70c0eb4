#include "api/mqtt/mqtt_status.hpp"

#include <nlohmann/json.hpp>

#include "api/kit/or_null.hpp"
#include "core/ports/broker.hpp"

namespace anchord::api {
namespace {

constexpr double k_alarm_s = 10;  ///< a broker that restarts is back by then

}  // namespace

nlohmann::ordered_json broker_json(const BrokerStatus& s) {
  return {{"state", s.connected ? "connected" : "disconnected"},
          {"broker", s.address},
          {"tls", s.tls},
          {"reason", text_or_null(s.reason)},
          {"in_state_s", s.in_state_s},
          {"messages", s.messages},
          {"connections", s.connections},
          {"failures", s.failures}};
}

std::string broker_metrics(const BrokerStatus& s) {
  std::string out;
  const auto add = [&out](const std::string& name, const char* type, std::uint64_t value, const char* help) {
    out += "# HELP " + name + ' ' + help + "\n# TYPE " + name + ' ' + type + '\n' + name + ' ' +
           std::to_string(value) + '\n';
  };
  add("anchord_mqtt_connected", "gauge", s.connected ? 1 : 0, "Whether the MQTT broker is connected");
  add("anchord_mqtt_messages_total", "counter", s.messages, "Messages sent to the MQTT broker");
  add("anchord_mqtt_connections_total", "counter", s.connections,
      "Connections that the MQTT broker accepted");
  add("anchord_mqtt_failures_total", "counter", s.failures,
      "Connections to the MQTT broker that failed or ended");
  return out;
}

std::string broker_alarm(const BrokerStatus& s) {
  if (s.connected || s.in_state_s < k_alarm_s) return {};
  return "nothing can be published to the MQTT broker " + s.address + ": " + s.reason;
}

}  // namespace anchord::api
