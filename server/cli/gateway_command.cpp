#include <signal.h>
#include <sys/stat.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/signals.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/gateway/gateway.hpp"
#include "server/http/http_client.hpp"
#include "server/runtime/logging.hpp"
#include "server/runtime/service_manager.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;

struct GatewayOptions {
  gateway::GatewayOptions gateway;
  std::string token_file, data_dir{"anchord-gateway"}, mission, log_level{"info"};
  std::uint64_t max_mib{4096}, recordings_max_mib{8192};
  bool json{false};
};

int run_gateway(GatewayOptions& options) {
  auto& g = options.gateway;
  if (g.to.empty())
    return failed("anchord gateway",
                  "--to is missing: the address of the server, like http://192.168.1.10:8420", 2);
  if (!options.mission.empty()) {
    const auto id = parse_uuid(options.mission);
    if (!id) return failed("anchord gateway", "--mission: " + id.error().message, 2);
    g.mission = MissionId{id.value()};
  }
  g.token_file = options.token_file;
  g.data_dir = options.data_dir;
  g.max_bytes = options.max_mib << 20;
  g.max_recording_bytes = options.recordings_max_mib << 20;
  g.version = ANCHORD_VERSION;
  block_signals({SIGTERM, SIGINT});
  umask(077);
  server::start_logging(options.log_level);
  auto started = gateway::FieldGateway::start(g);
  if (!started)
    return failed("anchord gateway", started.error().message,
                  started.error().code == Errc::invalid_argument ? 2 : 1);
  (void)server::notify_service_manager("READY=1");
  (void)wait_for_signal({SIGTERM, SIGINT});
  (void)server::notify_service_manager("STOPPING=1");
  started.value()->stop();
  server::log(server::LogLevel::info, "stopped");
  return 0;
}

std::string text(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_string() ? at->get<std::string>() : std::string();
}
double number(const Json& object, const char* key) {
  const auto at = object.find(key);
  return at != object.end() && at->is_number() ? at->get<double>() : 0;
}

void print_status(const Json& s) {
  const auto link = s.value("link", Json::object()), outbox = s.value("outbox", Json::object());
  const auto rows = s.value("rows", Json::object()), mission = s.value("mission", Json::object());
  const auto line = [](const char* name, const std::string& value) {
    std::printf("%-10s %s\n", name, printable(value).c_str());
  };
  char buffer[200];
  line("server", text(s, "to"));
  std::snprintf(buffer, sizeof buffer, " for %.0f s, %.1f kB/s", number(link, "in_state_s"),
                number(link, "bytes_per_s") / 1000);
  const auto reason = text(link, "reason");
  line("link", text(link, "state") + buffer + (reason.empty() ? "" : ": " + reason));
  const auto id = text(mission, "id");
  line("mission", (id.empty() ? "none" : id) + " (" + text(mission, "from") + ")");
  std::snprintf(buffer, sizeof buffer, "%.0f rows, %.1f of %.0f MiB", number(outbox, "rows"),
                number(outbox, "bytes") / (1 << 20), number(outbox, "max_bytes") / (1 << 20));
  line("waiting", buffer);
  std::snprintf(buffer, sizeof buffer, "%.0f kept, %.0f accepted, %.0f duplicates, %.0f rejected, %.0f lost",
                number(rows, "kept"), number(rows, "accepted"), number(rows, "duplicates"),
                number(rows, "rejected"), number(rows, "lost"));
  line("rows", buffer);
  if (outbox.contains("live_age_s") && outbox["live_age_s"].is_number()) {
    std::snprintf(buffer, sizeof buffer, "newest row at the server is %.1f s old",
                  number(outbox, "live_age_s"));
    line("live", buffer);
  }
  for (const auto& d : s.value("devices", Json::array())) {
    std::snprintf(buffer, sizeof buffer, " %.1f/s", number(d, "rate_hz"));
    const auto why = text(d, "reason");
    line("device", text(d, "name") + " " + text(d, "address") + " " + text(d, "state") + buffer +
                       (why.empty() ? "" : ": " + why));
  }
  for (const auto& a : s.value("alarms", Json::array()))
    line("ALARM", text(a, "code") + ": " + text(a, "text"));
}

int status(const GatewayOptions& options) {
  const auto url = running_server(options.data_dir);
  if (!url)
    return failed("anchord gateway",
                  "no gateway is running on the data folder " + options.data_dir +
                      ": start 'anchord gateway --to URL', or give its --data-dir",
                  1);
  auto client = server::HttpClient::to(*url, std::chrono::seconds(5));
  if (!client) return failed("anchord gateway", client.error().message, 1);
  const auto answer = client.value().call("GET", "/status");
  if (!answer) return failed("anchord gateway", answer.error().message, 1);
  const auto json = Json::parse(answer.value().body, nullptr, false);
  if (answer.value().status != 200 || !json.is_object() || !json.contains("outbox"))
    return failed("anchord gateway", *url + " is not a gateway: give the --data-dir of the gateway", 1);
  if (options.json)
    std::printf("%s\n", printable_json(answer.value().body).c_str());
  else
    print_status(json);
  return json.value("alarms", Json::array()).empty() ? 0 : 1;
}

}  // namespace

void add_gateway_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand(
      "gateway",
      "Record devices on an aircraft's computer or a field laptop and send their rows to a server");
  const auto options = std::make_shared<GatewayOptions>();
  auto& o = *options;
  command->add_option("--to", o.gateway.to, "address of the server, like http://192.168.1.10:8420")
      ->envname("ANCHORD_GATEWAY_TO");
  command
      ->add_option("--token-file", o.token_file,
                   "file with an access token of the server (roles gateway and viewer); read again when it "
                   "is rejected")
      ->envname("ANCHORD_GATEWAY_TOKEN_FILE");
  command
      ->add_option("--data-dir", o.data_dir,
                   "folder of outbox, recordings and devices.json [anchord-gateway]")
      ->envname("ANCHORD_GATEWAY_DATA_DIR");
  command
      ->add_option("--device", o.gateway.devices,
                   "kind=address, like gnss=serial:/dev/ttyACM0; may be repeated; in addition to those of "
                   "devices.json")
      ->allow_extra_args(false);
  command->add_option("--mission", o.mission,
                      "id of the mission that the rows belong to, also those stored without one [the mission "
                      "that has the server's devices]");
  command
      ->add_option("--max-mib", o.max_mib,
                   "largest size of the outbox in MiB; when it is full, no new rows are added [4096]")
      ->check(CLI::Range(1, 1 << 20));
  command->add_flag("--new-outbox", o.gateway.new_outbox,
                    "make a new outbox where the one of this folder is missing or empty");
  command
      ->add_option("--recordings-max-mib", o.recordings_max_mib,
                   "largest size of the raw recordings in MiB; beyond it the oldest are deleted [8192]")
      ->check(CLI::Range(1, 1 << 20));
  command->add_option("--listen", o.gateway.listen,
                      "loopback address of /status, /healthz, /readyz and /metrics [127.0.0.1:8421]");
  command->add_option("--log-level", o.log_level, "debug, info, warning or error [info]")
      ->check(CLI::IsMember({"debug", "info", "warning", "error"}));
  command->require_subcommand(0, 1);
  command->fallthrough();
  auto* shown = command->add_subcommand(
      "status", "Show a running gateway (exit code 1: not running, or an alarm is active)");
  shown->add_flag("--json", o.json, "print JSON as the gateway sends it");
  shown->callback([&exit_code, options] { exit_code = status(*options); });
  command->callback([&exit_code, options, command] {
    if (command->get_subcommands().empty()) exit_code = run_gateway(*options);
  });
}

}  // namespace anchord::cli
