#include <CLI/CLI.hpp>
#include <cstdio>

#include "server/cli/commands.hpp"

namespace anchord::cli {

void add_version_command(CLI::App& app, int& exit_code) {
  app.set_version_flag("--version", "anchord " ANCHORD_VERSION);
  auto* command = app.add_subcommand("version", "Print the version");
  command->callback([&exit_code] {
    std::printf("anchord %s\n", ANCHORD_VERSION);
    exit_code = 0;
  });
}

}  // namespace anchord::cli
