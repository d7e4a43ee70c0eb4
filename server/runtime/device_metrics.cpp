#include "server/runtime/device_metrics.hpp"

namespace anchord::server {

std::string device_metrics(const std::vector<DeviceReport>& all, std::uint64_t rows_lost) {
  if (all.empty()) return {};
  std::string out;
  const auto label = [](const DeviceReport& d) {
    return "{device=\"" + to_string(d.config.id) + "\",kind=\"" + d.config.kind + "\"";
  };
  const auto family = [&](const char* name, const char* type, const char* help, auto value) {
    out += std::string("# HELP ") + name + " " + help + "\n# TYPE " + name + " " + type + "\n";
    for (const auto& d : all) out += name + label(d) + "} " + std::to_string(value(d)) + "\n";
  };
  family("anchord_device_talking", "gauge", "1 while valid frames are received",
         [](const DeviceReport& d) { return d.state == "talking" ? 1 : 0; });
  family("anchord_device_received_bytes_total", "counter", "Bytes received",
         [](const auto& d) { return d.bytes_in; });
  family("anchord_device_sent_bytes_total", "counter", "Bytes sent",
         [](const auto& d) { return d.bytes_out; });
  family("anchord_device_frames_total", "counter", "Reads with a valid frame",
         [](const auto& d) { return d.frames; });
  family("anchord_device_fixes_total", "counter", "Positions decoded", [](const auto& d) { return d.fixes; });
  family("anchord_device_ranges_total", "counter", "Ranges decoded", [](const auto& d) { return d.ranges; });
  family("anchord_device_lost_total", "counter", "Links that were lost",
         [](const auto& d) { return d.lost; });
  out +=
      "# HELP anchord_device_dropped_total Data that was not used, by reason\n# TYPE "
      "anchord_device_dropped_total "
      "counter\n";
  for (const auto& d : all) {
    for (const auto& [reason, n] : d.dropped) {
      out += "anchord_device_dropped_total" + label(d) + ",reason=\"" + reason + "\"} " + std::to_string(n) +
             "\n";
    }
  }
  out +=
      "# HELP anchord_device_rows_lost_total Rows that were lost because the database did not store them in "
      "time\n"
      "# TYPE anchord_device_rows_lost_total counter\nanchord_device_rows_lost_total " +
      std::to_string(rows_lost) + "\n";
  return out;
}

}  // namespace anchord::server
