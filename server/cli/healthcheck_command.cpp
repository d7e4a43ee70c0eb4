#include <CLI/CLI.hpp>
#include <cstdio>

#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/server_address.hpp"
#include "server/http/http_client.hpp"

namespace anchord::cli {

void add_healthcheck_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("healthcheck",
                                     "Check whether a running server is ready (exit code 0: ready, 1: not)");
  const auto url = std::make_shared<std::string>();
  const auto data_dir = std::make_shared<std::string>("anchord-data");
  command->add_option("--url", *url, "address of the server [the server of the data folder]");
  command->add_option("--data-dir", *data_dir, "folder of the database [anchord-data]")
      ->envname("ANCHORD_DATA_DIR");
  command->callback([&exit_code, url, data_dir] {
    exit_code = 1;
    const std::string address =
        !url->empty() ? *url : running_server(*data_dir).value_or("http://127.0.0.1:8420");
    auto client = server::HttpClient::to(address, std::chrono::seconds(5));
    if (!client) {
      std::fprintf(stderr, "%s\n", printable(client.error().message).c_str());
      return;
    }
    const auto answer = client.value().call("GET", "/readyz");
    if (!answer) {
      std::fprintf(stderr, "%s\n", printable(answer.error().message).c_str());
      return;
    }
    std::printf("%s\n", answer.value().body.c_str());
    if (answer.value().status == 200) exit_code = 0;
  });
}

}  // namespace anchord::cli
