#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/base/text.hpp"
#include "core/base/to_wire.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/failed.hpp"
#include "server/cli/progress.hpp"
#include "server/cli/rest_json.hpp"
#include "server/cli/server_address.hpp"
#include "server/cli/text_table.hpp"

namespace anchord::cli {
namespace {

using Json = nlohmann::json;

struct CirArchiveOptions {
  std::string data_dir{"anchord-data"}, url, mission, to{"file"};
  bool json{false};
};

Result<std::unique_ptr<RestClient>> server_of(const CirArchiveOptions& options) {
  const auto url = options.url.empty() ? running_server(options.data_dir) : std::optional(options.url);
  if (!url)
    return make_error(Errc::not_found, "no server is running on the data folder " + options.data_dir +
                                           ": start anchord serve, or give --url");
  return RestClient::make(*url, own_token(options.data_dir), interrupted);
}

Result<Json> archived(RestClient& client) {
  BOOST_OUTCOME_TRY(const auto json, get_json(client, "/api/v1/cir-archive"));
  return json.value("items", Json::array());
}

/// Where the responses of a flight are.
std::string place_of(const Json& one) {
  if (one.value("n_moved", std::uint64_t{0}) == 0) return "database";
  return one.value("here", false) ? "file" : "MISSING";
}

void print(const Json& items) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& one : items)
    rows.push_back({text_of(one, "mission"), text_of(one, "name"), place_of(one),
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

int show(const CirArchiveOptions& options, const Json& items) {
  if (options.json)
    std::printf("%s\n", printable_json(to_wire(items, 1)).c_str());
  else if (items.empty())
    std::printf("no flight has impulse responses in a file\n");
  else
    print(items);
  return 0;
}

int list(const CirArchiveOptions& options) {
  auto client = server_of(options);
  if (!client) return failed("anchord cir-archive", client.error().message);
  const auto items = archived(*client.value());
  return items ? show(options, items.value()) : failed("anchord cir-archive", items.error().message);
}

Result<Json> moved(const CirArchiveOptions& options) {
  BOOST_OUTCOME_TRY(auto client, server_of(options));
  BOOST_OUTCOME_TRY(const auto job, post_json(*client, "/api/v1/missions/" + options.mission + "/cir-archive",
                                              {{"to", options.to}}));
  BOOST_OUTCOME_TRYV(result_of_job(*client, job));
  BOOST_OUTCOME_TRY(const auto items, archived(*client));
  Json out = Json::array();
  for (const auto& one : items)
    if (text_of(one, "mission") == options.mission) out.push_back(one);
  return out;
}

int move(const CirArchiveOptions& options) {
  const auto items = moved(options);
  return items ? show(options, items.value()) : failed("anchord cir-archive", items.error().message);
}

}  // namespace

void add_cir_archive_command(CLI::App& app, int& exit_code) {
  auto* command =
      app.add_subcommand("cir-archive",
                         "List flights whose impulse responses are in files, and move them between "
                         "database and file, on a running server");
  auto options = std::make_shared<CirArchiveOptions>();
  command->add_option("--data-dir", options->data_dir, "Data folder of the server")
      ->capture_default_str()
      ->envname("ANCHORD_DATA_DIR");
  command->add_option("--url", options->url, "URL of another server");
  command->add_flag("--json", options->json, "Print JSON");
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
