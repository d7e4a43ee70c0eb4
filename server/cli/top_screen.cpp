#include "server/cli/top_screen.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string_view>

#include "server/cli/text_table.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;
using Rows = std::vector<std::vector<std::string>>;

constexpr double k_failed_shown_s = 3600;  ///< a job that failed longer ago is history: GET /jobs has it

struct Section {
  std::string title;
  std::vector<std::string> lines;
  std::size_t kept_first{};  ///< lines that stay when the terminal is low: titles of a table
  std::size_t left_out{};
};

Json parsed(const TopDocument& document) {
  auto json = Json::parse(document.body, nullptr, false);
  return json.is_object() ? json : Json::object();
}

Json at(const Json& json, const char* key) {
  const auto it = json.is_object() ? json.find(key) : json.end();
  return it == json.end() ? Json() : *it;
}

std::string text(const Json& json, const char* key) {
  const auto value = at(json, key);
  return value.is_string() ? value.get<std::string>() : std::string();
}

std::optional<double> number(const Json& json, const char* key) {
  const auto value = at(json, key);
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}

bool flag(const Json& json, const char* key) {
  const auto value = at(json, key);
  return value.is_boolean() && value.get<bool>();
}

/// The objects of a list; what else is in it is left out.
std::vector<Json> items(const TopDocument& document) {
  std::vector<Json> out;
  const auto json = at(parsed(document), "items");
  if (!json.is_array()) return out;
  for (const auto& item : json)
    if (item.is_object()) out.push_back(item);
  return out;
}

std::string capitals(std::string text) {
  for (auto& c : text)
    if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
  return text;
}

/// "-" for what is not known.
std::string written(std::optional<double> value, int decimals) {
  if (!value || !std::isfinite(*value)) return "-";
  char out[64];
  std::snprintf(out, sizeof out, std::abs(*value) < 1e15 ? "%.*f" : "%.*e", decimals, *value);
  return out;
}

std::string seconds(std::optional<double> value) { return written(value, value && *value < 10 ? 1 : 0); }

std::string bytes(std::optional<double> value) {
  if (!value) return "-";
  if (*value >= 1e9) return written(*value / 1e9, 1) + " GB";
  return written(*value / 1e6, 1) + " MB";
}

/// "2026-05-04 10:11:12 UTC".
std::string clock_time(UtcTime t) {
  auto out = to_rfc3339(t).substr(0, 19);
  if (out.size() > 10) out[10] = ' ';
  return out + " UTC";
}

/// How long ago by the server's own clock; never below zero, since a device may stamp a moment ahead.
std::optional<double> ago_s(std::optional<double> t_us, double now_us) {
  if (!t_us) return std::nullopt;
  return std::max(0.0, (now_us - *t_us) / 1e6);
}

/// "12 s", "3 min", "5 h", "41 days"
std::string age(std::optional<double> s) {
  if (!s) return seconds(s);
  constexpr double k_min = 60, k_h = 3600, k_day = 86'400;
  if (*s < 2 * k_min) return seconds(s) + " s";
  if (*s < 2 * k_h) return seconds(*s / k_min) + " min";
  if (*s < 2 * k_day) return seconds(*s / k_h) + " h";
  return seconds(*s / k_day) + " days";
}

std::optional<double> time_us(const Json& json, const char* key) {
  const auto t = parse_rfc3339(text(json, key));
  return t ? std::optional(static_cast<double>(t.value().us())) : std::nullopt;
}

/// A sample of the Prometheus text: `name` with its labels as the server writes them.
std::optional<double> sample(const TopDocument& metrics, std::string_view name) {
  const std::string_view all = metrics.body;
  for (std::size_t begin = 0; begin < all.size();) {
    const auto end = std::min(all.find('\n', begin), all.size());
    const auto line = all.substr(begin, end - begin);
    begin = end + 1;
    if (!line.starts_with(name) || line.size() <= name.size() || line[name.size()] != ' ') continue;
    const auto rest = line.substr(name.size() + 1);
    double value = 0;
    if (std::from_chars(rest.data(), rest.data() + rest.size(), value).ec == std::errc()) return value;
  }
  return std::nullopt;
}

std::size_t columns_for(std::size_t width) { return width > 2 ? width - 2 : width; }

/// A table below its title, or why there is none.
Section section(std::string title, const TopDocument& document, std::vector<std::string> table,
                const std::string& none) {
  if (!document.problem.empty()) return {std::move(title), {"not shown: " + document.problem}, 1, 0};
  if (Json::parse(document.body, nullptr, false).is_discarded())
    return {std::move(title), {"not shown: the answer is not JSON"}, 1, 0};
  if (table.size() <= 1) return {std::move(title), {none}, 1, 0};
  return {std::move(title), std::move(table), 1, 0};
}

std::string counted(const char* title, std::size_t n) {
  return n == 0 ? title : std::string(title) + " (" + std::to_string(n) + ")";
}

Section alarms(const TopDocuments& documents, double now_us, std::size_t width) {
  Rows rows;
  for (const auto& alarm : items(documents.alarms))
    rows.push_back({text(alarm, "priority"), seconds(ago_s(number(alarm, "since_us"), now_us)),
                    flag(alarm, "acknowledged") ? "yes" : "no", text(alarm, "text")});
  const auto n = rows.size();
  auto table = table_lines({{"PRIORITY", false, false},
                            {"SINCE, s ago", true, false},
                            {"ACKNOWLEDGED", false, false},
                            {"TEXT", false, true}},
                           rows, width);
  return section(counted("ALARMS", n), documents.alarms, std::move(table), "none");
}

std::string has_devices(const Json& mission) {
  const auto devices = at(mission, "devices");
  if (!devices.is_object()) return "none";
  if (flag(devices, "recording")) return "recording";
  const auto holder = text(at(devices, "held_by"), "name");
  return holder.empty() ? "not recording" : "held by " + holder;
}

std::string aircraft(const Json& drone) {
  if (!drone.is_object()) return "";
  if (!flag(drone, "connected")) {
    const auto silent = number(drone, "silent_s");
    return "Aircraft: NOT CONNECTED" +
           (silent ? ", silent for " + seconds(silent) + " s" : std::string(", nothing received"));
  }
  std::string out = "Aircraft: " + text(drone, "mode");
  out += flag(drone, "armed") ? ", ARMED" : ", DISARMED";
  out += flag(drone, "in_air") ? ", IN AIR" : ", ON GROUND";
  if (flag(drone, "failsafe")) out += ", FAILSAFE";
  if (flag(drone, "taken_over")) out += ", flown by the pilot";
  if (const auto battery = number(drone, "battery")) out += ", battery " + written(*battery * 100, 0) + " %";
  if (const auto up = number(drone, "above_home_m")) out += ", " + written(up, 1) + " m above home";
  return out;
}

Section missions(const TopDocuments& documents, double now_us, std::size_t width) {
  Rows rows;
  for (const auto& mission : items(documents.missions)) {
    if (text(mission, "state") != "recording") continue;
    rows.push_back({text(mission, "name"), seconds(ago_s(time_us(mission, "created_at"), now_us)),
                    written(number(mission, "n_ranges"), 0), written(number(mission, "n_fixes"), 0),
                    has_devices(mission)});
  }
  auto table = table_lines({{"NAME", false, true},
                            {"CREATED, s ago", true, false},
                            {"RANGES, rows", true, false},
                            {"POSITIONS, rows", true, false},
                            {"DEVICES", false, true}},
                           rows, width);
  auto out = section("MISSION IN FLIGHT", documents.missions, std::move(table), "no mission is recording");
  if (const auto line = aircraft(at(parsed(documents.system), "drone")); !line.empty()) {
    out.lines.insert(out.lines.begin(), line);
    ++out.kept_first;
  }
  return out;
}

std::optional<double> total(const Json& counts) {
  if (!counts.is_object()) return std::nullopt;
  double sum = 0;
  for (const auto& count : counts)
    if (count.is_number()) sum += count.get<double>();
  return sum;
}

Section devices(const TopDocuments& documents, double now_us, std::size_t width) {
  Rows rows;
  std::size_t radios = 0;
  std::optional<double> last_radio_s;
  for (const auto& device : items(documents.devices)) {
    const auto seen_s = ago_s(number(device, "last_seen_us"), now_us);
    if (!device.contains("address")) {  // a radio that a tag measured, no device of this server
      ++radios;
      if (seen_s) last_radio_s = std::min(*seen_s, last_radio_s.value_or(*seen_s));
      continue;
    }
    auto why = text(device, "reason");
    if (why.empty()) why = text(device, "conflict");
    rows.push_back({text(device, "name"), text(device, "kind"), capitals(text(device, "state")),
                    written(number(device, "rate_hz"), 1), seconds(seen_s),
                    written(total(at(device, "dropped")), 0), why});
  }
  const auto n = rows.size();
  auto table = table_lines({{"NAME", false, true},
                            {"KIND", false, false},
                            {"STATE", false, false},
                            {"RATE, rows/s", true, false},
                            {"LAST FRAME, s ago", true, false},
                            {"REJECTED, count", true, false},
                            {"REASON", false, true}},
                           rows, width);
  auto out = section(counted("DEVICES", n), documents.devices, std::move(table),
                     "no device is set up: run anchord devices discover, then anchord devices add");
  if (radios > 0)
    out.lines.push_back("Radios seen in the measurements: " + std::to_string(radios) + ", last seen " +
                        age(last_radio_s) + " ago");
  return out;
}

Section queues(const TopDocuments& documents, std::size_t width) {
  const auto& metrics = documents.metrics;
  Rows rows{{"rows waiting for storage or estimation",
             written(number(parsed(documents.system), "queue_depth"), 0)}};
  struct Queue {
    const char* what;
    const char* metric;
  };
  constexpr Queue k_queues[]{{"of these, rows for live estimates", "anchord_live_queue_rows"},
                             {"commands", "anchord_command_queue"},
                             {"requests", "anchord_worker_queue"},
                             {"computations", "anchord_heavy_queue"}};
  if (metrics.problem.empty())
    for (const auto& [what, metric] : k_queues) rows.push_back({what, written(sample(metrics, metric), 0)});
  Section out{"QUEUES", table_lines({{"QUEUE", false, true}, {"WAITING, count", true, false}}, rows, width),
              1, 0};
  if (!documents.system.problem.empty()) out.lines.push_back("rows not shown: " + documents.system.problem);
  if (!metrics.problem.empty()) {
    out.lines.push_back("metrics not shown: " + metrics.problem);
    return out;
  }
  const auto lines = [&](const char* result) {
    return written(sample(metrics, std::string("anchord_ingest_lines_total{result=\"") + result + "\"}"), 0);
  };
  out.lines.push_back("Rows since the start: " + lines("accepted") + " accepted, " + lines("duplicate") +
                      " duplicate, " + lines("rejected") + " rejected");
  return out;
}

Section jobs(const TopDocuments& documents, double now_us, std::size_t width) {
  Rows rows;
  for (const auto& job : items(documents.jobs)) {
    const auto state = text(job, "state");
    const auto progress = at(job, "progress");
    if (state == "queued" || state == "running") {
      const auto fraction = number(progress, "fraction");
      rows.push_back({text(job, "kind"), capitals(state),
                      written(fraction ? std::optional(*fraction * 100) : std::nullopt, 0),
                      seconds(number(progress, "eta_s")), text(progress, "stage")});
    } else if (state == "failed") {
      const auto ended_s = ago_s(time_us(job, "finished_at"), now_us);
      if (!ended_s || *ended_s > k_failed_shown_s) continue;
      const auto problem = at(job, "problem");
      const auto detail = text(problem, "detail");
      rows.push_back({text(job, "kind"), capitals(state), "-", "-",
                      seconds(ended_s) + " s ago: " + (detail.empty() ? text(problem, "title") : detail)});
    }
  }
  const auto n = rows.size();
  auto table = table_lines({{"KIND", false, true},
                            {"STATE", false, false},
                            {"DONE, %", true, false},
                            {"REMAINING, s", true, false},
                            {"STAGE", false, true}},
                           rows, width);
  return section(counted("JOBS", n), documents.jobs, std::move(table), "none queued or running");
}

std::string health(const TopDocument& ready) {
  if (!ready.problem.empty()) return "Health: unknown: " + ready.problem;
  const auto json = parsed(ready);
  const auto status = text(json, "status");
  std::string out = "Health: " + (status.empty() ? std::string("not known") : capitals(status));
  const auto checks = at(json, "checks");
  if (checks.is_object() && status != "ready")
    for (const auto& [check, state] : checks.items())
      if (state.is_string() && state != "ok") out += "; " + check + ": " + state.get<std::string>();
  return out;
}

std::vector<std::string> head(const TopDocuments& documents, const TopReading& reading) {
  const auto version = parsed(documents.version), system = parsed(documents.system);
  std::string title = "anchord " + text(version, "version");
  if (const auto git = text(version, "git"); !git.empty()) title += " (" + git + ")";
  std::vector<std::string> out{title + " at " + reading.url};
  if (reading.away) {
    out.push_back("SERVER NOT REACHABLE since " + clock_time(reading.away->since) + ": " + reading.away->why);
    out.push_back("OLD data of " + clock_time(reading.read_at) + ", " +
                  seconds(std::max(0.0, seconds_between(reading.read_at, reading.now))) +
                  " s ago; trying again until it answers");
  } else {
    out.push_back("Read " + clock_time(reading.read_at));
  }
  out.push_back(health(documents.ready));
  if (!documents.system.problem.empty()) return out;
  std::string line = flag(system, "recording") ? "Recording: yes" : "Recording: no";
  line += "   Live clients: " + written(number(system, "ws_clients"), 0);
  line += "   Database: " + bytes(number(system, "db_bytes"));
  line += "   Disk free: " + bytes(number(system, "disk_free_bytes"));
  out.push_back(line);
  return out;
}

std::size_t height(const std::vector<Section>& sections) {
  std::size_t lines = 0;
  for (const auto& s : sections) lines += 2 + s.lines.size() + (s.left_out > 0 ? 1 : 0);
  return lines;
}

/// Shortens the longest section, again and again, until all of them fit or none can give more.
void fit(std::vector<Section>& sections, std::size_t rows) {
  while (height(sections) > rows) {
    const auto longest = std::ranges::max_element(sections, {}, [](const Section& s) {
      return s.lines.size() > s.kept_first ? s.lines.size() - s.kept_first : 0;
    });
    if (longest == sections.end() || longest->lines.size() <= longest->kept_first) return;
    longest->lines.pop_back();
    ++longest->left_out;
  }
}

}  // namespace

std::vector<std::string> top_lines(const TopDocuments& documents, const TopReading& reading, TopSize size) {
  const double now_us =
      number(parsed(documents.system), "t_us").value_or(static_cast<double>(reading.read_at.us()));
  const auto width = columns_for(size.columns);
  auto out = head(documents, reading);
  std::vector<Section> sections{alarms(documents, now_us, width), missions(documents, now_us, width),
                                devices(documents, now_us, width), queues(documents, width),
                                jobs(documents, now_us, width)};
  if (size.rows > 0) fit(sections, size.rows > out.size() ? size.rows - out.size() : 0);
  for (const auto& s : sections) {
    out.emplace_back();
    out.push_back(s.title + (reading.away ? " - OLD" : ""));
    for (const auto& line : s.lines) out.push_back("  " + line);
    if (s.left_out > 0) out.push_back("  and " + std::to_string(s.left_out) + " more lines");
  }
  if (size.rows > 0 && out.size() > size.rows) out.resize(size.rows);
  for (auto& line : out) {
    line = one_line(line);
    if (size.columns > 0) line = cut_to(line, size.columns);
  }
  return out;
}

}  // namespace anchord::cli
