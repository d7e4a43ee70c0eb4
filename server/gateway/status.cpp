#include "server/gateway/status.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::gateway {
namespace {

using Ordered = nlohmann::ordered_json;

constexpr double k_link_alarm_s = 10;  ///< shorter ones are the nature of such links
constexpr double k_clock_alarm_s = 5;
constexpr double k_filling_share = 0.8;
constexpr std::uint64_t k_little_disk_bytes = 256u << 20;

std::string mib(std::uint64_t bytes) { return std::to_string(bytes >> 20) + " MiB"; }

Ordered time_json(const std::optional<UtcTime>& time) {
  return time ? Ordered(time->us()) : Ordered(nullptr);
}

std::string seconds_text(double s) {
  char text[32];
  std::snprintf(text, sizeof text, "%.0f s", s);
  return text;
}

/// How far the server is behind the newest row; absent: nothing was delivered yet.
std::optional<double> live_age_s(const Status& s) {
  if (!s.sender.newest_delivered) return std::nullopt;
  return seconds_between(*s.sender.newest_delivered, s.now);
}

void link_alarms(const Status& s, std::vector<Alarm>& out) {
  const auto link = s.sender.link;
  if (Sender::needs_a_person(link))
    out.push_back(
        {"gateway.refused", "the server does not accept rows: " + s.sender.why + ". Everything is kept"});
  else if (link != Link::up && link != Link::unknown && s.link_s > k_link_alarm_s)
    out.push_back({"gateway.link", "no link to " + s.to + " for " + seconds_text(s.link_s) + ": " +
                                       s.sender.why + ". Rows are kept and sent when the link is back"});
  else if (link == Link::up && !s.sender.why.empty())
    out.push_back({"gateway.disk_write", s.sender.why});
  for (const auto& [mission, why] : s.sender.held)
    out.push_back({"gateway.mission_unknown", "rows of mission " + to_string(mission) +
                                                  " are waiting, the server answers " + why +
                                                  ": restore the mission there, or import its bundle"});
}

void disk_alarms(const Status& s, std::vector<Alarm>& out) {
  if (!s.outbox.trouble.empty())
    out.push_back(
        {"gateway.full",
         "rows are NOT stored on this machine: " + s.outbox.trouble +
             ". The newest rows are in memory, and go to the server while there is a link; when memory is "
             "full, the oldest of them are lost. Raw bytes are recorded as long as the disk has space"});
  else if (static_cast<double>(s.outbox.bytes) > k_filling_share * static_cast<double>(s.outbox.max_bytes))
    out.push_back({"gateway.filling", "the outbox has " + mib(s.outbox.bytes) + " of " +
                                          mib(s.outbox.max_bytes) +
                                          ": restore the link, or increase --max-mib"});
  if (s.disk_free_bytes < k_little_disk_bytes)
    out.push_back({"gateway.disk", "the disk has " + mib(s.disk_free_bytes) + " left (limit " +
                                       mib(k_little_disk_bytes) + "): free some"});
  if (s.rows_dropped > 0)
    out.push_back({"gateway.rows_lost", std::to_string(s.rows_dropped) +
                                            " rows were lost while the outbox could not store them; "
                                            "'anchord replay' restores them from the recording"});
  if (!s.recorder_failure.empty())
    out.push_back({"gateway.recording", "raw bytes are not recorded: " + s.recorder_failure});
}

void mission_alarms(const Status& s, std::vector<Alarm>& out) {
  if (s.outbox.unassigned_rows > 0)
    out.push_back({"gateway.no_mission", std::to_string(s.outbox.unassigned_rows) +
                                             " rows have no mission: restart the gateway with --mission ID, "
                                             "the id of the mission on the server that they belong to"});
  if (!s.sender.mission_problem.empty()) out.push_back({"gateway.mission", s.sender.mission_problem});
  if (s.outbox.totals.rejected > 0)
    out.push_back(
        {"gateway.rows_rejected", "the server rejected " + std::to_string(s.outbox.totals.rejected) +
                                      " rows; each is written with its reason to " + s.rejected_file});
  if (!s.not_started.empty()) out.push_back({"device.not_started", s.not_started});
}

/// A receiver's time is used before the system clock's: then the clock is no matter of rows, and the
/// difference to the server's is its own.
void clock_alarms(const Status& s, std::vector<Alarm>& out) {
  const double ahead_s = s.sender.clock_ahead_s;
  if (!s.clock_skew.empty())
    out.push_back({"clock.skew", s.clock_skew});
  else if (std::abs(ahead_s) > k_clock_alarm_s)
    out.push_back({"gateway.clock",
                   "the clock of this machine is " + seconds_text(std::abs(ahead_s)) +
                       (ahead_s > 0 ? " ahead of" : " behind") +
                       " the server's, and rows of devices without GNSS time are stamped by it: set the "
                       "one that is wrong (NTP)"});
}

Ordered link_json(const Status& s) {
  const bool up = s.sender.link == Link::up;
  return {{"state", k_link_words.word(s.sender.link)},
          {"reason", s.sender.why.empty() ? Ordered(nullptr) : Ordered(s.sender.why)},
          {"in_state_s", s.link_s},
          {"last_answer_us", time_json(s.sender.last_answer)},
          {"next_try_s", up ? Ordered(nullptr) : Ordered(s.sender.next_try_s)},
          {"bytes_per_s", s.sender.bytes_per_s},
          {"bytes_sent", s.sender.bytes_sent},
          {"requests", s.sender.requests},
          {"clock_ahead_s", s.sender.clock_ahead_s}};
}

Ordered outbox_json(const Status& s) {
  const auto live = live_age_s(s);
  return {{"rows", s.outbox.rows},
          {"rows_without_mission", s.outbox.unassigned_rows},
          {"rows_in_memory", s.outbox.rows_in_memory},
          {"bytes", s.outbox.bytes},
          {"max_bytes", s.outbox.max_bytes},
          {"oldest_us", time_json(s.oldest_waiting)},
          {"newest_delivered_us", time_json(s.sender.newest_delivered)},
          {"live_age_s", live ? Ordered(*live) : Ordered(nullptr)}};
}

Ordered devices_json(const Status& s) {
  Ordered out = Ordered::array();
  for (const auto& d : s.devices) {
    out.push_back({{"name", d.config.name},
                   {"kind", d.config.kind},
                   {"address", d.config.address},
                   {"state", d.state},
                   {"reason", d.reason.empty() ? Ordered(nullptr) : Ordered(d.reason)},
                   {"rate_hz", d.rows_per_s},
                   {"fixes", d.fixes},
                   {"ranges", d.ranges}});
  }
  return out;
}

}  // namespace

std::vector<Alarm> alarms_of(const Status& status) {
  std::vector<Alarm> out;
  disk_alarms(status, out);
  link_alarms(status, out);
  mission_alarms(status, out);
  clock_alarms(status, out);
  return out;
}

std::string ready_json(const Status& status) {
  if (status.outbox.trouble.empty()) return R"({"status":"ready"})";
  return to_wire(Ordered{{"status", "not ready"}, {"reason", status.outbox.trouble}});
}

std::string status_json(const Status& s) {
  Ordered alarms = Ordered::array();
  for (const auto& alarm : alarms_of(s)) alarms.push_back({{"code", alarm.code}, {"text", alarm.text}});
  const auto& totals = s.outbox.totals;
  return to_wire(
      Ordered{{"version", s.version},
              {"to", s.to},
              {"uptime_s", s.uptime_s},
              {"now_us", s.now.us()},
              {"link", link_json(s)},
              {"mission",
               {{"id", s.sender.mission ? Ordered(to_string(*s.sender.mission)) : Ordered(nullptr)},
                {"from", k_mission_from_words.word(s.sender.mission_from)}}},
              {"outbox", outbox_json(s)},
              {"rows",
               {{"kept", totals.kept},
                {"accepted", totals.accepted},
                {"duplicates", totals.duplicates},
                {"rejected", totals.rejected},
                {"lost", s.rows_dropped}}},
              {"disk_free_bytes", s.disk_free_bytes},
              {"devices", devices_json(s)},
              {"alarms", std::move(alarms)}});
}

std::string metrics_text(const Status& s) {
  struct Metric {
    const char *name, *type, *help;
    double value;
  };
  const auto n = [](std::uint64_t value) { return static_cast<double>(value); };
  const auto& totals = s.outbox.totals;
  const std::array metrics{
      Metric{"anchord_gateway_link_up", "gauge", "1 while the server accepts rows",
             s.sender.link == Link::up ? 1.0 : 0.0},
      Metric{"anchord_gateway_outbox_rows", "gauge", "Rows waiting to be sent to the server",
             n(s.outbox.rows)},
      Metric{"anchord_gateway_rows_in_memory", "gauge",
             "Rows that wait in memory alone, since the disk does not take them", n(s.outbox.rows_in_memory)},
      Metric{"anchord_gateway_outbox_bytes", "gauge", "Size of the waiting rows on the disk",
             n(s.outbox.bytes)},
      Metric{"anchord_gateway_outbox_max_bytes", "gauge", "Size of the outbox beyond which no row is stored",
             n(s.outbox.max_bytes)},
      Metric{"anchord_gateway_live_age_seconds", "gauge",
             "Age of the newest row that the server has; 0 before the first", live_age_s(s).value_or(0)},
      Metric{"anchord_gateway_bytes_per_second", "gauge", "Speed of the newest requests with rows",
             s.sender.bytes_per_s},
      Metric{"anchord_gateway_disk_free_bytes", "gauge", "Free space on the disk of the data folder",
             n(s.disk_free_bytes)},
      Metric{"anchord_gateway_alarms", "gauge", "Active alarms", n(alarms_of(s).size())},
      Metric{"anchord_gateway_rows_kept_total", "counter", "Rows written to the outbox", n(totals.kept)},
      Metric{"anchord_gateway_rows_accepted_total", "counter", "Rows that the server stored",
             n(totals.accepted)},
      Metric{"anchord_gateway_rows_duplicate_total", "counter", "Rows that the server already had",
             n(totals.duplicates)},
      Metric{"anchord_gateway_rows_rejected_total", "counter", "Rows that the server rejected",
             n(totals.rejected)},
      Metric{"anchord_gateway_rows_lost_total", "counter",
             "Rows that were lost because the outbox could not store them in time", n(s.rows_dropped)},
      Metric{"anchord_gateway_requests_total", "counter", "Requests to the server", n(s.sender.requests)},
      Metric{"anchord_gateway_sent_bytes_total", "counter", "Bytes of request bodies sent and answered",
             n(s.sender.bytes_sent)}};
  std::string out;
  for (const auto& m : metrics) {
    char value[32];
    std::snprintf(value, sizeof value, "%.17g", m.value);
    out += std::string("# HELP ") + m.name + " " + m.help + "\n# TYPE " + m.name + " " + m.type + "\n" +
           m.name + " " + value + "\n";
  }
  return out;
}

}  // namespace anchord::gateway
