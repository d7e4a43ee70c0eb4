#pragma once

#include <string>
#include <vector>

#include "core/ports/devices.hpp"
#include "server/gateway/outbox.hpp"
#include "server/gateway/sender.hpp"

namespace anchord::gateway {

/// All that the gateway tells of itself, gathered at one moment.
struct Status {
  std::string version, to;
  double uptime_s{};
  UtcTime now{};
  SenderStatus sender;
  double link_s{};  ///< how long the link has been what it is
  OutboxState outbox;
  std::optional<UtcTime> oldest_waiting;
  std::uint64_t disk_free_bytes{};
  std::vector<DeviceReport> devices;
  std::string recorder_failure, not_started;
  std::string clock_skew;        ///< the system clock against the receiver's, in words; empty: right
  std::uint64_t rows_dropped{};  ///< the outbox did not take them in time, and memory was full
  std::string rejected_file;
};

struct Alarm {
  std::string code, text;
};
/// What is wrong, the worst first, each with what to do.
std::vector<Alarm> alarms_of(const Status& status);
/// {"status": "ready"}, or why rows cannot be kept now.
std::string ready_json(const Status& status);

std::string status_json(const Status& status);
/// Prometheus text, without that of the devices.
std::string metrics_text(const Status& status);

}  // namespace anchord::gateway
