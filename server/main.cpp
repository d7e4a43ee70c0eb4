#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <iostream>
#include <utility>

#include "core/base/guard.hpp"
#include "core/base/text.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/usage.hpp"

namespace {

struct Command {
  const char* group;  ///< in the help; empty: not listed
  void (*add)(CLI::App&, int&);
};

/// In the order of use.
constexpr Command k_commands[]{
    {"Run a server", anchord::cli::add_serve_command},
    {"Run a server", anchord::cli::add_top_command},
    {"Run a server", anchord::cli::add_doctor_command},
    {"Run a server", anchord::cli::add_support_command},
    {"Run a server", anchord::cli::add_devices_command},
    {"Run a server", anchord::cli::add_token_command},
    {"Run a server", anchord::cli::add_tls_command},
    {"Run a server", anchord::cli::add_backup_command},
    {"Run a server", anchord::cli::add_cir_archive_command},
    {"Run a server", anchord::cli::add_database_command},
    {"Run a server", anchord::cli::add_gateway_command},
    {"Run a server", anchord::cli::add_sync_command},
    {"Run a server", anchord::cli::add_config_command},
    {"Run a server", anchord::cli::add_healthcheck_command},
    {"Plan and measure", anchord::cli::add_plan_command},
    {"Plan and measure", anchord::cli::add_simulate_command},
    {"Plan and measure", anchord::cli::add_decode_command},
    {"Plan and measure", anchord::cli::add_import_command},
    {"Plan and measure", anchord::cli::add_replay_command},
    {"Find anchors", anchord::cli::add_solve_command},
    {"Find anchors", anchord::cli::add_profile_command},
    {"Find anchors", anchord::cli::add_frame_command},
    {"Find anchors", anchord::cli::add_verify_command},
    {"Train models", anchord::cli::add_campaign_command},
    {"Train models", anchord::cli::add_dataset_command},
    {"Train models", anchord::cli::add_train_command},
    {"Train models", anchord::cli::add_evaluate_command},
    {"Train models", anchord::cli::add_models_command},
    {"Train models", anchord::cli::add_rules_command},
    {"This program", anchord::cli::add_completion_command},
    {"This program", anchord::cli::add_man_command},
    {"This program", anchord::cli::add_version_command},
    {"", anchord::cli::add_worker_command},
};

/// Whether all of the output has left: a full disk behind `>` shows only when the last of it is written.
bool printed() {
  std::cout.flush();
  errno = 0;
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0 && std::cout) return true;
  const int why = errno;
  // Who reads no further (`| head`) needs no explanation.
  if (why != EPIPE)
    std::fprintf(stderr, "anchord: cannot write the output%s%s\n", why != 0 ? ": " : "",
                 why != 0 ? std::strerror(why) : "");
  return false;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{"anchord: finds where a building's UWB anchors are on the globe", "anchord"};
  app.require_subcommand(1);
  int exit_code = 0;
  const auto all = [](const CLI::App*) { return true; };
  for (const auto& command : k_commands) {
    const auto before = std::as_const(app).get_subcommands(all).size();
    command.add(app, exit_code);
    const auto subs = app.get_subcommands([](CLI::App*) { return true; });
    for (std::size_t i = before; i < subs.size(); ++i) subs[i]->group(command.group);
  }
  if (argc < 2) {
    std::fputs(app.help().c_str(), stderr);
    return 2;
  }
  const auto ran = anchord::guarded("the command", [&] {
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      const auto unknown = anchord::cli::unknown_word(app, {argv + 1, static_cast<std::size_t>(argc - 1)});
      if (error.get_exit_code() != 0 && !unknown.empty()) {
        std::fprintf(stderr, "anchord: %s\nRun with --help for more information.\n",
                     anchord::printable(unknown).c_str());
        exit_code = 2;
      } else {
        exit_code = app.exit(error) == 0 ? 0 : 2;
      }
    }
  });
  if (!printed() && exit_code == 0) exit_code = 1;
  return ran ? exit_code : 1;
}
