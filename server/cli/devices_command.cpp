#include <CLI/CLI.hpp>
#include <cstdio>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>

#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/terminal_text.hpp"
#include "server/config/toml_json.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {
namespace {

using Ordered = nlohmann::ordered_json;

struct DevicesOptions {
  std::string data_dir{"anchord-data"}, url, device, kind, address, name, action, arguments, anchor;
  std::vector<std::string> settings;
  bool json{false};
};

/// The running server, asked with the token of its own folder.
class Server {
 public:
  static Result<Server> of(const DevicesOptions& options) {
    const auto url = options.url.empty() ? running_server(options.data_dir) : std::optional(options.url);
    if (!url) {
      return make_error(Errc::not_found, "no server is running on the data folder " + options.data_dir +
                                             ": start anchord serve, or give --url");
    }
    // A discovery listens for seconds, an action may wait for its device.
    BOOST_OUTCOME_TRY(auto client, server::HttpClient::to(*url, std::chrono::seconds(30)));
    if (const auto token = own_token(options.data_dir); !token.empty()) {
      client.set_header("Authorization", "Bearer " + token);
    }
    return Server(std::move(client));
  }

  Result<Ordered> call(std::string_view method, const std::string& target, const std::string& body = {}) {
    BOOST_OUTCOME_TRY(const auto answer, client_.call(method, target, body));
    auto json = Ordered::parse(answer.body, nullptr, false);
    if (answer.status >= 400) {
      return make_error(answer.status == 404 ? Errc::not_found : Errc::invalid_argument,
                        api::problem_text(answer.body));
    }
    if (json.is_discarded()) json = nullptr;
    return json;
  }
  void header(const std::string& name, const std::string& value) { client_.set_header(name, value); }

 private:
  explicit Server(server::HttpClient client) : client_(std::move(client)) {}
  server::HttpClient client_;
};

std::string text(const Ordered& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

Result<Ordered> configured(Server& server) {
  BOOST_OUTCOME_TRY(const auto all, server.call("GET", "/api/v1/devices"));
  Ordered out = Ordered::array();
  for (const auto& item : all.value("items", Ordered::array())) {
    if (item.contains("address")) out.push_back(item);
  }
  return out;
}

/// By id, the beginning of it, or name. errors: not_found, conflict (several).
Result<Ordered> find(Server& server, const std::string& word) {
  BOOST_OUTCOME_TRY(const auto all, configured(server));
  std::vector<Ordered> hits;
  for (const auto& device : all) {
    if (text(device, "id").starts_with(word) || text(device, "name") == word) hits.push_back(device);
  }
  if (hits.empty()) return make_error(Errc::not_found, "there is no device \"" + word + "\"");
  if (hits.size() > 1)
    return make_error(Errc::conflict, "\"" + word + "\" matches several devices: use the id");
  return hits.front();
}

std::string shown(const Ordered& object, const char* key) { return one_line(text(object, key)); }

void print_device(const Ordered& d) {
  const auto dropped = d.value("dropped", Ordered::object());
  std::uint64_t n = 0;
  for (const auto& [reason, count] : dropped.items()) n += count.get<std::uint64_t>();
  std::printf("%s  %-6s %-16s %-8s %6.1f/s  %s\n", shown(d, "id").c_str(), shown(d, "kind").c_str(),
              shown(d, "name").c_str(), shown(d, "state").c_str(), d.value("rate_hz", 0.0),
              shown(d, "address").c_str());
  for (const char* key : {"reason", "conflict"}) {
    if (!text(d, key).empty()) std::printf("    %s\n", shown(d, key).c_str());
  }
  if (n > 0) std::printf("    not used: %s\n", printable_json(to_wire(dropped)).c_str());
}

int show(const DevicesOptions& options, const Result<Ordered>& list, const char* none,
         void (*print)(const Ordered&)) {
  if (!list) return failed("anchord devices", list.error().message);
  if (options.json) {
    std::printf("%s\n", printable_json(to_wire(list.value(), 1)).c_str());
    return 0;
  }
  for (const auto& item : list.value()) print(item);
  if (list.value().empty()) std::printf("%s\n", none);
  return 0;
}

int list(const DevicesOptions& options, Server& server) {
  return show(options, configured(server),
              "no device is set up: run anchord devices discover, then anchord devices add", print_device);
}

int discover(const DevicesOptions& options, Server& server) {
  server.header("Prefer", "wait=20");
  auto found = server.call("POST", "/api/v1/discovery", "{}");
  if (!found) return failed("anchord devices", found.error().message);
  if (!found.value().contains("items"))
    return failed("anchord devices", "the discovery takes longer than 20 s: run the command again");
  const char* none = "no unused serial port was found; a network device is added by its address";
  return show(options, found.value()["items"], none, [](const Ordered& d) {
    const auto kind = shown(d, "kind");
    std::printf("%-6s %s\n    %s\n", kind.empty() ? "?" : kind.c_str(), shown(d, "address").c_str(),
                shown(d, "evidence").c_str());
  });
}

/// "name=rover", "enabled=false", "address=...", everything else is an option of the kind.
Result<Ordered> patch_of(const std::vector<std::string>& settings) {
  Ordered out = Ordered::object();
  for (const auto& setting : settings) {
    const auto equals = setting.find('=');
    if (equals == std::string::npos)
      return make_error(Errc::invalid_argument, "\"" + setting + "\" is not key=value");
    const auto key = setting.substr(0, equals), raw = setting.substr(equals + 1);
    if (key == "password_file") {
      // Read here, with the rights of who asks: the server takes no path.
      std::ifstream in(raw);
      std::string password;
      if (!std::getline(in, password))
        return make_error(Errc::invalid_argument, "password_file: " + raw + " cannot be read, or is empty");
      if (password.ends_with('\r')) password.pop_back();
      out["options"]["password"] = password;
      continue;
    }
    if (key == "mapping_file") {
      BOOST_OUTCOME_TRY(const auto mapping, server::read_as_json(raw));
      out["options"]["mapping"] = Ordered::parse(mapping, nullptr, false);
      continue;
    }
    if (key == "password") {
      out["options"][key] = raw;  // 123456 is a text too
      continue;
    }
    auto value = Ordered::parse(raw, nullptr, false);
    if (value.is_discarded()) value = raw;
    if (key == "name" || key == "address" || key == "kind") {
      out[key] = raw;
    } else if (key == "enabled") {
      out[key] = value;
    } else {
      out["options"][key] = value;
    }
  }
  return out;
}

int add(const DevicesOptions& options, Server& server) {
  auto body = patch_of(options.settings);
  if (!body) return failed("anchord devices", body.error().message, 2);
  body.value()["kind"] = options.kind;
  body.value()["address"] = options.address;
  body.value()["name"] = options.name.empty() ? options.kind : options.name;
  const auto made = server.call("POST", "/api/v1/devices", to_wire(body.value()));
  if (!made) return failed("anchord devices", made.error().message);
  std::printf("%s\n", shown(made.value(), "id").c_str());
  return 0;
}

int settings(const DevicesOptions& options, Server& server) {
  const auto device = find(server, options.device);
  if (!device) return failed("anchord devices", device.error().message);
  if (options.settings.empty()) {
    std::printf("%s\n", printable_json(to_wire(device.value(), 1)).c_str());
    return 0;
  }
  const auto patch = patch_of(options.settings);
  if (!patch) return failed("anchord devices", patch.error().message, 2);
  server.header("If-Match", "*");
  const auto changed =
      server.call("PATCH", "/api/v1/devices/" + text(device.value(), "id"), to_wire(patch.value()));
  if (!changed) return failed("anchord devices", changed.error().message);
  print_device(changed.value());
  return 0;
}

int remove(const DevicesOptions& options, Server& server) {
  const auto device = find(server, options.device);
  if (!device) return failed("anchord devices", device.error().message);
  server.header("If-Match", "*");
  const auto done = server.call("DELETE", "/api/v1/devices/" + text(device.value(), "id"));
  return done ? 0 : failed("anchord devices", done.error().message);
}

int act(const DevicesOptions& options, Server& server) {
  const auto device = find(server, options.device);
  if (!device) return failed("anchord devices", device.error().message);
  Ordered body{{"action", options.action}};
  if (!options.arguments.empty()) {
    body["arguments"] = Ordered::parse(options.arguments, nullptr, false);
    if (!body["arguments"].is_object())
      return failed("anchord devices", "--arguments must be a JSON object", 2);
  }
  const auto done =
      server.call("POST", "/api/v1/devices/" + text(device.value(), "id") + "/actions", to_wire(body));
  if (!done) return failed("anchord devices", done.error().message);
  std::printf("%s\n", printable_json(to_wire(done.value().value("result", Ordered()), 1)).c_str());
  return 0;
}

}  // namespace

void add_devices_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("devices", "Tags, rovers and correction services of a running server");
  auto options = std::make_shared<DevicesOptions>();
  command->add_option("--data-dir", options->data_dir, "Data folder of the server")
      ->capture_default_str()
      ->envname("ANCHORD_DATA_DIR");
  command->add_option("--url", options->url, "URL of another server");
  command->add_flag("--json", options->json, "Print JSON as the server sends it");
  command->require_subcommand(0, 1);
  command->fallthrough();
  const auto run = [options, &exit_code](int (*what)(const DevicesOptions&, Server&)) {
    auto server = Server::of(*options);
    exit_code = server ? what(*options, server.value()) : failed("anchord devices", server.error().message);
  };
  command->add_subcommand("list", "Configured devices and their state")->callback([run] { run(list); });
  command->add_subcommand("discover", "Listen on every port that is not in use")->callback([run] {
    run(discover);
  });
  auto* made = command->add_subcommand("add", "Set up a device");
  made->add_option("kind", options->kind, "gnss, pozyx, ntrip, mqtt, ndjson or dwm1001")->required();
  made->add_option("address", options->address, "serial:/dev/serial/by-id/..., tcp://host:port, ...")
      ->required();
  made->add_option("settings", options->settings,
                   "key=value, e.g. format=ubx, mount=RTCM3, mapping_file=tags.toml");
  made->add_option("--name", options->name, "Name of the device, shown in the dashboard");
  made->callback([run] { run(add); });
  auto* set =
      command->add_subcommand("settings", "Show a device, or change it: name=..., enabled=false, format=ubx");
  set->add_option("device", options->device, "Id, the beginning of it, or name")->required();
  set->add_option("changes", options->settings, "key=value");
  set->callback([run] { run(settings); });
  auto* gone = command->add_subcommand("remove", "Remove a device");
  gone->add_option("device", options->device, "Id, the beginning of it, or name")->required();
  gone->callback([run] { run(remove); });
  auto* identify =
      command->add_subcommand("identify", "Blink the lights of a tag, or of an anchor in its range");
  identify->add_option("device", options->device, "Id, the beginning of it, or name")->required();
  identify->add_option("anchor", options->anchor, "Network id of an anchor, e.g. 0x6a21");
  identify->callback([run, options] {
    options->action = "identify";
    if (!options->anchor.empty()) options->arguments = to_wire(Ordered{{"network_id", options->anchor}});
    run(act);
  });
  auto* action = command->add_subcommand("action", "Send another command to a device");
  action->add_option("device", options->device, "Id, the beginning of it, or name")->required();
  action->add_option("action", options->action, "get_uwb, set_uwb, push_positions, range_between, ...")
      ->required();
  action->add_option(
      "--arguments", options->arguments,
      R"(JSON object, e.g. {"positions":[{"network_id":"0x6a21","x_m":1,"y_m":2,"z_m":2.5}]})");
  action->callback([run] { run(act); });
  command->callback([run, command] {
    if (command->get_subcommands().empty()) run(list);
  });
}

}  // namespace anchord::cli
