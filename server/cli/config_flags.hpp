#pragma once

#include <map>
#include <memory>
#include <string>

#include "core/base/result.hpp"
#include "server/config/config.hpp"

namespace CLI {
class App;
}

namespace anchord::cli {

/// Values of the settings' flags on one command; filled while parsing.
struct ConfigFlags {
  std::map<std::string, std::string> given;
  std::string file;
  Result<server::Config> load() const;
};

/// One flag per setting of the table, and --config FILE.
std::shared_ptr<ConfigFlags> add_config_flags(CLI::App& command);

/// --database of a command that opens the rows of a data folder itself.
void add_database_option(CLI::App& command, std::string& address);

}  // namespace anchord::cli
