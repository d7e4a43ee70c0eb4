#include "server/cli/doctor.hpp"

#include <arpa/inet.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/timex.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>

#include "api/measurements/flight_requests.hpp"
#include "core/base/time.hpp"
#include "drivers/link/serial_port.hpp"
#include "server/cli/server_address.hpp"
#include "server/http/http_client.hpp"
#include "server/storage/data_folder.hpp"
#include "server/storage/postgres_database.hpp"
#include "server/storage/postgres_text.hpp"
#include "server/storage/sqlite_connection.hpp"
#include "server/storage/work_store.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::cli {
namespace {

namespace fs = std::filesystem;
using Level = Finding::Level;
using Json = nlohmann::json;

constexpr double k_gb = 1e9;
constexpr double k_least_free_gb = 1, k_wanted_free_gb = 5;  ///< below 1 GB the checklist forbids to fly
constexpr std::uint64_t k_least_files = 1024;

std::string number(double value, int decimals = 1) {
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

Finding program() {
  utsname system{};
  const bool known = ::uname(&system) == 0;
  return {
      Level::ok, "program",
      "anchord " ANCHORD_VERSION ", database version " + std::to_string(newest_schema_version()) +
          (known ? std::string(", ") + system.sysname + " " + system.release + " " + system.machine : "")};
}

Finding folder(const fs::path& dir) {
  std::error_code error;
  if (!fs::exists(dir, error))
    return {Level::warning, "data folder", fs::absolute(dir).string() + ": does not exist",
            "the first 'anchord serve --data-dir " + dir.string() + "' creates it"};
  if (!fs::is_directory(dir, error))
    return {Level::failed, "data folder", dir.string() + ": is not a folder",
            "give another one with --data-dir"};
  if (::access(dir.c_str(), R_OK | W_OK | X_OK) != 0)
    return {Level::failed, "data folder", dir.string() + ": " + std::strerror(errno),
            "run anchord as the owner of the folder, or give it to the user who runs it (chown)"};
  return {Level::ok, "data folder", fs::absolute(dir).string()};
}

Finding disk(const fs::path& dir) {
  const fs::path at = fs::exists(dir) ? dir : fs::absolute(dir).parent_path();
  struct statvfs space {};
  if (::statvfs(at.c_str(), &space) != 0)
    return {Level::warning, "disk", at.string() + ": " + std::strerror(errno), "check the file system"};
  const double free_gb = static_cast<double>(space.f_bavail) * static_cast<double>(space.f_frsize) / k_gb;
  const std::string seen = number(free_gb) + " GB free";
  if (free_gb < k_least_free_gb)
    return {Level::failed, "disk", seen + ", a flight needs " + number(k_least_free_gb, 0) + " GB",
            "delete what is not needed, or move the data folder"};
  if (free_gb < k_wanted_free_gb)
    return {Level::warning, "disk", seen,
            "below " + number(k_wanted_free_gb, 0) + " GB: free some space soon"};
  return {Level::ok, "disk", seen};
}

/// Only of a folder that no server has open: what runs checks its own.
std::optional<Finding> database(const fs::path& dir) {
  const auto file = dir / "anchord.db";
  std::error_code error;
  if (!fs::exists(file, error)) return std::nullopt;
  const std::string size = number(static_cast<double>(fs::file_size(file, error)) / 1e6) + " MB";
  try {
    sql::SqliteConnection connection(file, sql::SqliteConnection::Mode::inspect, Synchronous::normal, {});
    const auto version = connection.pragma("user_version");
    if (version > newest_schema_version())
      return Finding{Level::failed, "database",
                     size + ", version " + std::to_string(version) + " of a newer anchord",
                     "install the version that wrote it"};
    if (const auto found = connection.check(false); found != "ok")
      return Finding{Level::failed, "database", size + ", damaged: " + found,
                     "stop anchord, copy the folder, then 'anchord backup restore FILE'"};
    return Finding{Level::ok, "database", size + ", version " + std::to_string(version) + ", intact"};
  } catch (const sql::SqlError& failure) {
    return Finding{Level::failed, "database", size + ", " + failure.what(),
                   "run as the owner of the folder; if it is damaged: 'anchord backup restore FILE'"};
  }
}

/// PostgreSQL is looked at also while a server runs: it may be the reason why that is not ready.
Finding postgres(const DoctorOptions& options) {
  const auto shown = sql::shown_address(options.database);
  const auto found = look_at_postgres(options.database);
  if (!found) return Finding{Level::failed, "database", found.error().message, "see docs/postgresql.md"};
  const auto& facts = found.value();
  std::string seen = shown + ", PostgreSQL " + facts.server_version + ", " +
                     number(static_cast<double>(facts.bytes) / 1e6) + " MB, version " +
                     std::to_string(facts.schema_version);
  if (facts.schema_version > newest_schema_version())
    return Finding{Level::failed, "database", seen + " of a newer anchord",
                   "install the version that wrote it"};
  if (!facts.server.empty()) seen += ", server " + facts.server;
  if (!facts.standby.empty()) seen += ", standby " + facts.standby;
  return Finding{Level::ok, "database", seen};
}

/// Who runs jobs of this database beside its server.
std::vector<Finding> workers_of(const std::string& address) {
  const auto work = open_work(address);
  if (!work) return {};  // of another version: the database itself was told of already
  const auto found = work.value()->workers();
  if (!found) return {{Level::warning, "workers", found.error().message, "see docs/workers.md"}};
  std::vector<Finding> out;
  for (const auto& w : found.value()) {
    std::string seen = w.name + ", anchord " + w.version + ", ";
    seen += w.job ? "running job " + to_string(*w.job) : "waiting for jobs";
    if (w.seen_s_ago > k_worker_silent_s)
      out.push_back(
          {Level::warning, "worker", seen + ", not seen for " + number(w.seen_s_ago, 0) + " s",
           "check whether it is still running; its job is taken over by another worker or the server"});
    else if (w.version != ANCHORD_VERSION)
      out.push_back({Level::warning, "worker", seen, "it claims only jobs of a server of its own version"});
    else
      out.push_back({Level::ok, "worker", seen});
  }
  if (out.empty()) out.push_back({Level::ok, "workers", "none: the server runs its jobs itself"});
  return out;
}

/// Rows that are elsewhere than the caller thinks.
std::optional<Finding> rows_elsewhere(const fs::path& dir) {
  const auto there = sql::postgres_of_folder(dir);
  if (there.empty()) return std::nullopt;
  return Finding{Level::warning, "database", "the database of this folder is " + there,
                 "give it with --database"};
}

/// Whether the certificate can be served, and for how long.
std::optional<Finding> certificate(const DoctorOptions& options) {
  if (options.tls_certificate.empty() && options.tls_key.empty()) return std::nullopt;
  const auto kept = server::TlsKeeper::open({options.tls_certificate, options.tls_key});
  if (!kept)
    return Finding{Level::failed, "certificate", kept.error().message,
                   "'anchord tls init' or 'anchord tls renew'"};
  const auto facts = kept.value()->facts();
  for (const auto& warning : server::tls_warnings(facts, std::nullopt, SystemClock{}.now()))
    return Finding{warning.critical ? Level::failed : Level::warning, "certificate", warning.text};
  return Finding{Level::ok, "certificate",
                 options.tls_certificate + ", until " + to_rfc3339(facts.not_after)};
}

/// Whether a server could listen there now.
Finding port(std::string address) {
  if (const auto scheme = address.find("://"); scheme != std::string::npos) address.erase(0, scheme + 3);
  const Finding unreadable{Level::warning, "port", address + ": not checked",
                           "only IPv4 addresses with a port can be checked"};
  const auto colon = address.rfind(':');
  if (colon == std::string::npos) return unreadable;
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_port = htons(static_cast<std::uint16_t>(std::strtoul(address.c_str() + colon + 1, nullptr, 10)));
  if (::inet_pton(AF_INET, address.substr(0, colon).c_str(), &at.sin_addr) != 1) return unreadable;
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  const int on = 1;
  (void)::setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
  const bool bound = fd >= 0 && ::bind(fd, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0;
  const int why = errno;
  if (fd >= 0) ::close(fd);
  if (bound) return {Level::ok, "port", address + " is free"};
  return {Level::failed, "port", address + ": " + std::strerror(why),
          why == EADDRINUSE
              ? "another program uses this port (ss -ltnp): end it, or give another one with --listen"
              : "give an address of this machine with --listen"};
}

Finding clock_set() {
  timex state{};
  const int answer = ::adjtimex(&state);
  const auto now = SystemClock{}.now();
  const std::string seen = to_rfc3339(now);
  if (now.ns < 1'735'689'600'000'000'000)  // 2025
    return {Level::failed, "clock", seen, "set the clock: measurements are matched and stored by it"};
  if (answer < 0 || answer == TIME_ERROR || (state.status & STA_UNSYNC) != 0)
    return {
        Level::warning, "clock", seen + ", not synchronised",
        "timedatectl set-ntp true, or an NTP server in the field network; the receiver's time is compared "
        "with it in flight"};
  return {Level::ok, "clock", seen + ", synchronised"};
}

Finding open_files() {
  rlimit limit{};
  (void)::getrlimit(RLIMIT_NOFILE, &limit);
  const std::string seen = std::to_string(limit.rlim_cur) + " open files allowed";
  if (limit.rlim_cur < k_least_files)
    return {Level::warning, "limits", seen,
            "ulimit -n " + std::to_string(k_least_files) + ", or LimitNOFILE="};
  return {Level::ok, "limits", seen};
}

std::vector<Finding> serial_devices() {
  std::vector<Finding> out;
  for (const auto& one : link::list_serial_ports()) {
    if (one.id.empty() && one.device.find("ttyACM") == std::string::npos &&
        one.device.find("ttyUSB") == std::string::npos)
      continue;  // a line of the board: nobody plugged it in
    if (::access(one.device.c_str(), R_OK | W_OK) == 0)
      out.push_back({Level::ok, "serial device", one.path});
    else
      out.push_back({Level::failed, "serial device", one.path + ": " + std::strerror(errno),
                     "sudo usermod -aG dialout $USER, then log in again"});
  }
  if (out.empty()) out.push_back({Level::ok, "serial devices", "none connected"});
  return out;
}

/// Of an answer that may be of anything; empty where it is no text.
std::string text_of(const Json& json, const char* key) {
  const auto it = json.is_object() ? json.find(key) : json.end();
  return json.is_object() && it != json.end() && it->is_string() ? it->get<std::string>() : std::string{};
}

std::vector<Finding> devices_of(server::HttpClient& client) {
  std::vector<Finding> out;
  const auto answer = client.call("GET", "/api/v1/devices");
  if (!answer || answer.value().status != 200) {
    out.push_back({Level::warning, "devices",
                   answer ? api::problem_text(answer.value().body) : answer.error().message,
                   "run as the owner of the data folder, or set ANCHORD_TOKEN"});
    return out;
  }
  const auto json = Json::parse(answer.value().body, nullptr, false);
  const auto items = json.is_object() ? json.value("items", Json::array()) : json;
  for (const auto& one : items) {
    const auto text = [&](const char* key) { return text_of(one, key); };
    const auto state = text("state");
    if (state.empty()) continue;  // a radio that was received, no device of this server
    const bool well = state == "talking" || state == "off";
    const std::string name = text("name").empty() ? text("address") : text("name");
    out.push_back({well ? Level::ok : Level::warning, "device",
                   text("kind") + " " + name + ": " + state + (well ? "" : ", " + text("reason")),
                   well ? "" : "see System in the dashboard"});
  }
  return out;
}

/// The server that has the folder, when one answers.
std::optional<std::vector<Finding>> server_of(const fs::path& dir) {
  const auto url = running_server(dir);
  if (!url) return std::nullopt;
  auto client = server::HttpClient::to(*url, std::chrono::seconds(3));
  if (!client) return std::nullopt;
  const auto began = std::chrono::steady_clock::now();
  const auto ready = client.value().call("GET", "/readyz");
  if (!ready) return std::nullopt;  // an address left by a server that was killed
  const double ms =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - began).count();
  std::vector<Finding> out;
  const std::string seen = *url + " answers after " + number(ms) + " ms";
  out.push_back(ready.value().status == 200
                    ? Finding{Level::ok, "server", seen}
                    : Finding{Level::failed, "server", seen + ": not ready: " + ready.value().body,
                              "see its log, and Alarms in the dashboard"});
  if (const auto token = own_token(dir); !token.empty())
    client.value().set_header("Authorization", "Bearer " + token);
  const auto version = client.value().call("GET", "/version");
  const auto json = version ? Json::parse(version.value().body, nullptr, false) : Json();
  if (text_of(json, "version") != ANCHORD_VERSION)
    out.push_back({Level::warning, "server version", "runs " + text_of(json, "version"),
                   "restart it to run " ANCHORD_VERSION});
  for (auto& one : devices_of(client.value())) out.push_back(std::move(one));
  return out;
}

}  // namespace

std::vector<Finding> examine(const DoctorOptions& options) {
  std::vector<Finding> out{program(), folder(options.data_dir), disk(options.data_dir)};
  const auto add = [&](std::vector<Finding> more) {
    for (auto& one : more) out.push_back(std::move(one));
  };
  if (!options.database.empty()) {
    out.push_back(postgres(options));
    if (out.back().level == Level::ok) add(workers_of(options.database));
  } else if (auto found = rows_elsewhere(options.data_dir)) {
    out.push_back(*std::move(found));
  }
  if (auto running = server_of(options.data_dir)) {
    add(*std::move(running));
  } else {
    if (auto found = database(options.data_dir); found && options.database.empty())
      out.push_back(*std::move(found));
    for (const auto& address : options.listen) out.push_back(port(address));
  }
  if (auto found = certificate(options)) out.push_back(*std::move(found));
  out.push_back(clock_set());
  out.push_back(open_files());
  add(serial_devices());
  return out;
}

}  // namespace anchord::cli
