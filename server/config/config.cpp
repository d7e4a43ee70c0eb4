#include "server/config/config.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "core/base/check.hpp"
#include "server/config/toml_file.hpp"
#include "server/http/text.hpp"
#include "server/storage/postgres_text.hpp"

extern char** environ;

namespace anchord::server {
namespace {

using enum OptionKind;

constexpr std::array k_options = {
    Option{"listen", "127.0.0.1:8420",
           "addresses to listen on, separated by commas; with port 0 the system chooses one; http:// before "
           "an address: unencrypted even if there is a certificate",
           list},
    Option{"data_dir", "anchord-data", "folder of the database; created if it does not exist"},
    Option{"database", "",
           "PostgreSQL database, like postgresql://user@host/name, with its password in ~/.pgpass or the "
           "file of PGPASSFILE; empty: SQLite in data_dir",
           database},
    Option{"standby", "false",
           "with database: wait while another server has it, and take over when that one ends", flag},
    Option{"standby_url", "",
           "with standby: where the other servers of the database reach this one, like http://10.0.0.7:8420; "
           "they pass on to it what they are asked while it has the database"},
    Option{"auth", "on",
           "off: no login, everyone may do everything; only on loopback addresses, for demonstrations",
           choice, "on|off"},
    Option{"insecure", "false", "allow addresses other than loopback without TLS", flag},
    Option{"tls.certificate", "",
           "PEM file of the server's certificate and the certificates that signed it: enables HTTPS; anchord "
           "tls init creates one"},
    Option{"tls.key", "", "PEM file of its private key, readable by its owner only"},
    Option{"allowed_hosts", "", "host names and addresses that clients may use, in addition to loopback",
           list},
    Option{"allowed_origins", "",
           "other web origins whose pages may use the API, like https://portal.example", list},
    Option{"trusted_proxies", "",
           "addresses or networks of proxies whose X-Forwarded-For and X-Forwarded-Proto are trusted", list},
    Option{"devices", "",
           "devices of this machine, kind=address, separated by commas; more by REST or anchord devices",
           list},
    Option{"log_level", "info", "lowest level that is logged", choice, "debug|info|warning|error"},
    Option{"log_slow_ms", "1000",
           "a request that takes longer is a warning in the log, unless it asked to wait; 0: none is", count},
    Option{"storage.synchronous", "full", "what a commit waits for; with full, data survives a power cut",
           choice, "normal|full|extra"},
    Option{"storage.device_queue", "100000",
           "rows of devices that may wait in memory for the database; beyond it the oldest are dropped, with "
           "alarm rows.lost",
           count},
    Option{"backup.schedule", "on",
           "a copy of the database every backup.every_h hours and after every flight", choice, "on|off"},
    Option{"backup.every_h", "24", "hours between two scheduled backups", count},
    Option{"backup.keep", "7", "number of intact backups that are kept, at least 7; older ones are deleted",
           count},
    Option{"backup.dir", "", "folder of the backups, if possible on another disk [DATA_DIR/backups]"},
    Option{"jobs.run_here", "on",
           "with PostgreSQL: on: calibrations and training runs that no worker takes are run by the server; "
           "off: they run "
           "only on workers (anchord worker)",
           choice, "on|off"},
    Option{"jobs.lease_s", "15",
           "with PostgreSQL: seconds without a sign of life of the server after which a worker takes over a "
           "job that the server runs",
           seconds},
    Option{"missions.keep_deleted_days", "30",
           "days of running time for which a deleted mission can be restored", count},
    Option{"missions.keep_cir_days", "off",
           "days after landing for which impulse responses, the bulk of a database, stay in it; after that "
           "they are moved into files in DATA_DIR/cir-archive, from which they are read as before; off: they "
           "stay",
           days},
    Option{"drone.address", "",
           "address of the MAVLink connection to the autopilot, like udp://:14550 (from this machine), "
           "udp://0.0.0.0:14550 (from the network, with a key), tcp://127.0.0.1:5760 or "
           "serial:/dev/ttyACM0; empty: flown by hand"},
    Option{"drone.signing_key_file", "",
           "file (mode 0600) with the key of MAVLink 2 signing; frames without its signature are rejected"},
    Option{"webhooks.allow_private", "false",
           "webhooks may go to addresses of this machine and of private networks", flag},
    Option{"webhooks.ca_file", "",
           "certificates (PEM) of the authorities that are trusted for receivers of webhooks; empty: those "
           "of the system"},
    Option{"mqtt.host", "",
           "host name of the MQTT broker to which anchors, estimates and alarms are published; empty: none"},
    Option{"mqtt.port", "1883", "port of the MQTT broker; 8883 is usual with TLS", count},
    Option{"mqtt.ca_file", "",
           "certificates (PEM) of the authorities that are trusted for the broker; enables TLS"},
    Option{"mqtt.user", "", "user name at the MQTT broker"},
    Option{"mqtt.password_file", "", "file (mode 0600) whose first line is the password at the MQTT broker"},
    Option{"mqtt.prefix", "anchord", "beginning of every topic; a different one for each server at a broker"},
    Option{"http.io_threads", "1", "threads for the sockets", count},
    Option{"http.workers", "4", "threads that run handlers", count},
    Option{"http.queue", "256", "requests that may wait for a handler; beyond it: 503", count},
    Option{"http.heavy_workers", "2", "threads for computations and large answers, at lower priority", count},
    Option{"http.heavy_queue", "32", "computations that may wait; beyond it: 503", count},
    Option{"http.heavy_per_token", "8", "computations of one token that may wait or run; beyond it: 429",
           count},
    Option{"http.upload_workers", "8", "threads for uploads that stream", count},
    Option{"http.max_connections", "4096",
           "sockets at the same time; beyond it the oldest idle one is closed, else 503", count},
    Option{"http.keep_alive_s", "75", "idle time of a connection between requests", seconds},
    Option{"http.head_s", "10", "time a request head may take", seconds},
    Option{"http.body_window_s", "20", "how long a body may stay below 1 KiB/s", seconds},
    Option{"http.write_stall_s", "30", "time without progress of a write", seconds},
    Option{"http.max_per_address", "1024", "sockets of one address at the same time, except trusted proxies",
           count},
    Option{"ws.max_connections", "64", "WebSocket clients at the same time; beyond it: close 1013", count},
    Option{"ws.per_token", "50", "WebSocket clients of one token at the same time; beyond it: close 4029",
           count},
    Option{"ws.reserved", "8", "WebSocket clients reserved for operators and admins", count},
    Option{"ws.message_bytes", "65536", "largest message a client may send", count},
    Option{"ws.ping_s", "15", "period of protocol pings", seconds},
    Option{"ws.idle_s", "45", "time without a message after which a connection is closed", seconds},
    Option{"goal.h95_m", "0.2",
           "an anchor without a target in a flown plan is accurate enough when its horizontal 95 % radius "
           "is within this",
           metres},
    Option{"goal.v95_m", "0.4",
           "an anchor without a target in a flown plan is accurate enough when its vertical 95 % bound is "
           "within this",
           metres},
    Option{"solve.site_outline", "on",
           "live solutions use the outline of the mission's site as a prior: anchors are inside", choice,
           "on|off"},
    Option{"solve.after_landing", "on",
           "a flight is calibrated automatically after landing; the result waits for review", choice,
           "on|off"},
    Option{"solve.max_correction_age_s", "30",
           "RTK fixed with corrections older than this counts as float, live and in calibrations", seconds},
    Option{"geoid.dir", "",
           "folder of a geoid model of GeographicLib, for heights above the sea [where GeographicLib looks]"},
    Option{"rate.per_s", "50", "requests per second of one token; beyond it: 429", count},
    Option{"rate.burst", "200", "requests that a token may send at once", count},
};

const Option* find(std::string_view key) {
  const auto* at = std::ranges::find(k_options, key, &Option::key);
  return at == k_options.end() ? nullptr : at;
}

std::string spelled(std::string_view key, char separator) {
  std::string out(key);
  std::ranges::replace(out, '.', separator);
  std::ranges::replace(out, '_', separator);
  return out;
}

std::optional<double> number(std::string_view text) {
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value))
    return {};
  return value;
}

/// As it may stand in a message: an address that is refused may have a password in it.
std::string shown(const Option& option, const std::string& value) {
  return option.kind == database ? sql::shown_address(value) : value;
}

/// Why the text does not suit the option; empty when it does.
std::string wrong(const Option& option, const std::string& value) {
  switch (option.kind) {
    case text:
    case list:
      return {};
    case flag:
      return value == "true" || value == "false" ? "" : "must be true or false";
    case count: {
      const auto n = number(value);
      return n && *n >= 1 && *n <= 1e9 && *n == std::floor(*n) ? "" : "must be a whole number from 1";
    }
    case days: {
      const auto n = number(value);
      if (value == "off" || (n && *n >= 1 && *n <= 36'500 && *n == std::floor(*n))) return {};
      return "must be off, or a whole number of days from 1 to 36500";
    }
    case seconds: {
      const auto n = number(value);
      return n && *n > 0 && *n <= 86'400 ? "" : "must be a number of seconds above 0, at most 86400";
    }
    case metres: {
      const auto n = number(value);
      return n && *n > 0 && *n <= 1000 ? "" : "must be a length in metres above 0, at most 1000";
    }
    case choice: {
      const auto words = split(option.choices, '|');
      if (std::ranges::find(words, value) != words.end()) return {};
      return "must be one of " + std::string(option.choices);
    }
    case database:
      return value.empty() ? "" : sql::address_fault(value);
  }
  return {};
}

}  // namespace

std::string Option::flag() const { return "--" + spelled(key, '-'); }

std::string Option::env() const {
  std::string out = "ANCHORD_" + spelled(key, '_');
  std::ranges::transform(out, out.begin(),
                         [](char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 32) : c; });
  return out;
}

std::span<const Option> options() { return k_options; }

const std::string& Config::text(std::string_view key) const {
  const auto at = values.find(key);
  ANCHORD_CHECK(at != values.end(), "no setting " << key);
  return at->second.text;
}
bool Config::flag(std::string_view key) const { return text(key) == "true"; }
std::size_t Config::count(std::string_view key) const {
  return static_cast<std::size_t>(number(text(key)).value_or(0));
}
std::chrono::milliseconds Config::seconds(std::string_view key) const {
  return std::chrono::milliseconds(std::llround(number(text(key)).value_or(0) * 1000));
}
double Config::metres(std::string_view key) const { return number(text(key)).value_or(0); }
std::vector<std::string> Config::list(std::string_view key) const {
  std::vector<std::string> out;
  for (const auto item : split(text(key), ',')) {
    if (!trim(item).empty()) out.emplace_back(trim(item));
  }
  return out;
}

Result<Config> load_config(const std::map<std::string, std::string>& flags,
                           const std::optional<std::filesystem::path>& file,
                           const std::vector<std::string>& environment) {
  Config config;
  std::string faults;
  const auto put = [&](std::string_view key, std::string value, Origin origin, const std::string& called) {
    const Option* option = find(key);
    if (option == nullptr) {
      faults += called + ": there is no such setting\n";
    } else if (const auto why = wrong(*option, value); !why.empty()) {
      faults += called + " = '" + shown(*option, value) + "': " + why + "\n";
    } else {
      config.values[std::string(key)] = {std::move(value), origin};
    }
  };
  for (const auto& option : k_options) {
    config.values[std::string(option.key)] = {std::string(option.default_value), Origin::standard};
  }
  if (file) {
    BOOST_OUTCOME_TRY(const auto entries, read_toml(*file));
    for (const auto& [key, value] : entries) put(key, value, Origin::file, file->string() + ": " + key);
  }
  for (const auto& line : environment) {
    if (!line.starts_with("ANCHORD_")) continue;
    const auto equals = std::min(line.find('='), line.size());
    const std::string name = line.substr(0, equals);
    const auto* at =
        std::ranges::find_if(k_options, [&](const Option& option) { return option.env() == name; });
    if (at == k_options.end()) {
      config.warnings.push_back("environment variable " + name + " is not a setting of the server");
    } else {
      put(at->key, line.substr(std::min(equals + 1, line.size())), Origin::environment, name);
    }
  }
  for (const auto& [key, value] : flags) {
    const Option* option = find(key);
    put(key, value, Origin::flag, option != nullptr ? option->flag() : key);
  }
  if (!faults.empty()) {
    faults.pop_back();
    return make_error(Errc::invalid_argument, std::move(faults));
  }
  return config;
}

HttpLimits http_limits(const Config& config) {
  HttpLimits limits;
  limits.max_connections = config.count("http.max_connections");
  limits.keep_alive = config.seconds("http.keep_alive_s");
  limits.head_time = config.seconds("http.head_s");
  limits.body_window = config.seconds("http.body_window_s");
  limits.write_stall = config.seconds("http.write_stall_s");
  limits.max_per_address = config.count("http.max_per_address");
  limits.heavy_per_token = config.count("http.heavy_per_token");
  return limits;
}

WsLimits ws_limits(const Config& config) {
  WsLimits limits;
  limits.message_bytes = config.count("ws.message_bytes");
  limits.ping = config.seconds("ws.ping_s");
  limits.idle = config.seconds("ws.idle_s");
  return limits;
}

std::vector<std::string> process_environment() {
  std::vector<std::string> lines;
  for (char** at = environ; at != nullptr && *at != nullptr; ++at) lines.emplace_back(*at);
  return lines;
}

}  // namespace anchord::server
