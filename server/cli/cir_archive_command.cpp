#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "api/measurements/flight_requests.hpp"
#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/job_answer.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/text_table.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {
namespace {

using Ordered = nlohmann::ordered_json;

struct Options {
  std::string data_dir{"anchord-data"}, url, mission, to{"file"};
  bool json{false};
};

int fail(const std::string& message) {
  std::fprintf(stderr, "anchord cir-archive: %s\n", printable(message).c_str());
  return 1;
}

Result<server::HttpClient> server_of(const Options& options) {
  const auto url = options.url.empty() ? running_server(options.data_dir) : std::optional(options.url);
  if (!url)
    return make_error(Errc::not_found, "no server is running on the data folder " + options.data_dir +
                                           ": start anchord serve, or give --url");
  BOOST_OUTCOME_TRY(auto client, server::HttpClient::to(*url, std::chrono::seconds(620)));
  if (const auto token = own_token(options.data_dir); !token.empty())
    client.set_header("Authorization", "Bearer " + token);
  return client;
}

Result<Ordered> archived(server::HttpClient& client) {
  BOOST_OUTCOME_TRY(const auto answer, client.call("GET", "/api/v1/cir-archive"));
  const auto json = Ordered::parse(answer.body, nullptr, false);
  if (answer.status >= 400 || !json.is_object())
    return make_error(Errc::unsupported, api::problem_text(answer.body));
  return json.value("items", Ordered::array());
}

std::string word(const Ordered& object, const char* key) {
  const auto it = object.find(key);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

/// Where the responses of a flight are.
std::string place_of(const Ordered& one) {
  if (one.value("n_moved", std::uint64_t{0}) == 0) return "database";
  return one.value("here", false) ? "file" : "MISSING";
}

void print(const Ordered& items) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& one : items)
    rows.push_back({word(one, "mission"), word(one, "name"), place_of(one),
                    std::to_string(one.value("n_moved", std::uint64_t{0})),
                    std::to_string(one.value("bytes", std::uint64_t{0}) >> 10)});
  for (const auto& line : table_lines({{"MISSION", false, false},
                                       {"NAME", false, false},
                                       {"RESPONSES IN", false, false},
                                       {"RESPONSES, count", true, false},
                                       {"SIZE, KiB", true, false}},
                                      rows, 0))
    std::printf("%s\n", line.c_str());
}

int show(const Options& options, const Ordered& items) {
  if (options.json)
    std::printf("%s\n", to_wire(items, 1).c_str());
  else if (items.empty())
    std::printf("no flight has impulse responses in a file\n");
  else
    print(items);
  return 0;
}

int list(const Options& options) {
  auto client = server_of(options);
  if (!client) return fail(client.error().message);
  const auto items = archived(client.value());
  return items ? show(options, items.value()) : fail(items.error().message);
}

int move(const Options& options) {
  auto client = server_of(options);
  if (!client) return fail(client.error().message);
  const auto done = answer_of_job(client.value(), "/api/v1/missions/" + options.mission + "/cir-archive",
                                  to_wire(Ordered{{"to", options.to}}));
  if (!done) return fail(done.error().message);
  const auto items = archived(client.value());
  if (!items) return fail(items.error().message);
  Ordered moved = Ordered::array();
  for (const auto& one : items.value())
    if (word(one, "mission") == options.mission) moved.push_back(one);
  return show(options, moved);
}

}  // namespace

void add_cir_archive_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("cir-archive",
                         "List flights whose impulse responses are in files, and move them between "
                         "database and file, on a running server");
  auto options = std::make_shared<Options>();
  command->add_option("--data-dir", options->data_dir, "Data folder of the server")
      ->capture_default_str()
      ->envname("ANCHORD_DATA_DIR");
  command->add_option("--url", options->url, "URL of another server");
  command->add_flag("--json", options->json, "Print JSON as the server sends it");
  command->require_subcommand(0, 1);
  command->fallthrough();
  command->add_subcommand("list", "Flights with a file: where it is, how much is in it")
      ->callback([options, &exit_code] { exit_code = list(*options); });
  auto* moved = command->add_subcommand("move", "Move the impulse responses of a landed flight now");
  moved->add_option("mission", options->mission, "Id of the mission")->required();
  moved->add_option("--to", options->to, "file, or database to bring them back")
      ->capture_default_str()
      ->check(CLI::IsMember({"file", "database"}));
  moved->callback([options, &exit_code] { exit_code = move(*options); });
  command->callback([command, options, &exit_code] {
    if (command->get_subcommands().empty()) exit_code = list(*options);
  });
}

}  // namespace anchord::cli
