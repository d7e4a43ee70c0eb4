#include <CLI/CLI.hpp>
#include <cstdio>

#include "core/base/guard.hpp"
#include "server/cli/commands.hpp"

int main(int argc, char** argv) {
  CLI::App app{"anchord: finds where a building's UWB anchors are on the globe", "anchord"};
  app.require_subcommand(1);
  int exit_code = 0;
  anchord::cli::add_backup_command(app, exit_code);
  anchord::cli::add_config_command(app, exit_code);
  anchord::cli::add_frame_command(app, exit_code);
  anchord::cli::add_healthcheck_command(app, exit_code);
  anchord::cli::add_import_command(app, exit_code);
  anchord::cli::add_decode_command(app, exit_code);
  anchord::cli::add_devices_command(app, exit_code);
  anchord::cli::add_plan_command(app, exit_code);
  anchord::cli::add_profile_command(app, exit_code);
  anchord::cli::add_serve_command(app, exit_code);
  anchord::cli::add_replay_command(app, exit_code);
  anchord::cli::add_simulate_command(app, exit_code);
  anchord::cli::add_token_command(app, exit_code);
  anchord::cli::add_rules_command(app, exit_code);
  anchord::cli::add_models_command(app, exit_code);
  anchord::cli::add_campaign_command(app, exit_code);
  anchord::cli::add_dataset_command(app, exit_code);
  anchord::cli::add_evaluate_command(app, exit_code);
  anchord::cli::add_train_command(app, exit_code);
  anchord::cli::add_solve_command(app, exit_code);
  anchord::cli::add_version_command(app, exit_code);
  anchord::cli::add_worker_command(app, exit_code);
  if (argc < 2) {
    std::fputs(app.help().c_str(), stderr);
    return 2;
  }
  const auto ran = anchord::guarded("the command", [&] {
    try {
      app.parse(argc, argv);
    } catch (const CLI::ParseError& error) {
      exit_code = app.exit(error) == 0 ? 0 : 2;
    }
  });
  return ran ? exit_code : 1;
}
