#include <CLI/CLI.hpp>
#include <cstdio>

#include "core/base/text.hpp"
#include "server/app/startup.hpp"
#include "server/cli/commands.hpp"
#include "server/cli/config_flags.hpp"

namespace anchord::cli {
namespace {

Result<server::Config> loaded(const ConfigFlags& flags) {
  auto config = flags.load();
  if (!config) {
    std::fprintf(stderr, "%s\n", printable(config.error().message).c_str());
    return config;
  }
  for (const auto& warning : config.value().warnings)
    std::fprintf(stderr, "warning: %s\n", printable(warning).c_str());
  return config;
}

}  // namespace

void add_config_command(CLI::App& app, int& exit_code) {
  auto* command = app.add_subcommand("config", "Check or show the settings");
  command->require_subcommand(1);
  auto* check = command->add_subcommand("check", "Check the settings in file, environment and flags");
  const auto check_flags = add_config_flags(*check);
  check->callback([&exit_code, check_flags] {
    const auto config = loaded(*check_flags);
    exit_code = 2;
    if (!config) return;
    if (const auto starts = server::check_startup(config.value()); !starts) {
      std::fprintf(stderr, "the server would not start: %s\n", printable(starts.error().message).c_str());
      return;
    }
    exit_code = 0;
    std::puts("configuration is valid");
  });
  auto* show = command->add_subcommand("show", "Print every setting, its value and its origin");
  const auto show_flags = add_config_flags(*show);
  show->callback([&exit_code, show_flags] {
    const auto config = loaded(*show_flags);
    exit_code = config ? 0 : 2;
    if (!config) return;
    for (const auto& option : server::options()) {
      const auto& value = config.value().values.find(option.key)->second;
      std::printf("%-22s %-24s %-12s %s\n", std::string(option.key).c_str(),
                  ("\"" + value.text + "\"").c_str(), std::string(server::to_string(value.origin)).c_str(),
                  std::string(option.help).c_str());
    }
  });
}

}  // namespace anchord::cli
