#include <CLI/CLI.hpp>

#include "server/cli/commands.hpp"
#include "server/runtime/worker_process.hpp"

namespace anchord::cli {

void add_worker_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("worker", "Heavy work of the server, which starts it by itself");
  command->callback([&exit_code] { exit_code = server::worker_main(); });
}

}  // namespace anchord::cli
