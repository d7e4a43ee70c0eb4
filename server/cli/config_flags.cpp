#include "server/cli/config_flags.hpp"

#include <CLI/CLI.hpp>

namespace anchord::cli {
namespace {

/// What an option takes, in the help.
std::string type_of(const server::Option& option) {
  using enum server::OptionKind;
  switch (option.kind) {
    case count:
      return "NUMBER";
    case seconds:
      return "SECONDS";
    case metres:
      return "METRES";
    case days:
      return "DAYS|off";
    case list:
      return "LIST";
    case choice:
      return std::string(option.choices);
    case database:
      return "URL";
    case text:
    case flag:
      break;
  }
  return "TEXT";
}

}  // namespace

Result<server::Config> ConfigFlags::load() const {
  std::optional<std::filesystem::path> path;
  if (!file.empty()) path = file;
  return server::load_config(given, path, server::process_environment());
}

std::shared_ptr<ConfigFlags> add_config_flags(CLI::App& command) {
  auto flags = std::make_shared<ConfigFlags>();
  command.add_option("--config", flags->file, "TOML file with settings");
  for (const auto& option : server::options()) {
    const std::string key(option.key);
    std::string help(option.help);
    if (!option.default_value.empty()) help += " [" + std::string(option.default_value) + "]";
    if (option.kind == server::OptionKind::flag) {
      command.add_flag_callback(
          option.flag(), [flags, key] { flags->given[key] = "true"; }, help);
    } else {
      command
          .add_option_function<std::string>(
              option.flag(), [flags, key](const std::string& text) { flags->given[key] = text; }, help)
          ->type_name(type_of(option));
    }
  }
  return flags;
}

void add_database_option(CLI::App& command, std::string& address) {
  command
      .add_option("--database", address,
                  "PostgreSQL database, like postgresql://user@host/name [SQLite in the data folder]")
      ->envname("ANCHORD_DATABASE");
}

}  // namespace anchord::cli
