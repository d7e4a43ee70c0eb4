#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

namespace anchord {
struct BrokerStatus;
}

namespace anchord::api {

/// As /system shows it.
nlohmann::ordered_json broker_json(const BrokerStatus& status);
/// Prometheus text.
std::string broker_metrics(const BrokerStatus& status);
/// Text of the alarm `mqtt.disconnected`; empty: the broker is there, or was lost a moment ago.
std::string broker_alarm(const BrokerStatus& status);

}  // namespace anchord::api
