#include "server/cli/words.hpp"

#include <CLI/CLI.hpp>
#include <utility>

namespace anchord::cli {

CLI::Option* add_word(CLI::App& command, const std::string& name, std::span<const std::string_view> words,
                      std::string_view standard, std::function<void(const std::string&)> set,
                      const std::string& help) {
  return command.add_option_function<std::string>(name, std::move(set), help)
      ->check(CLI::IsMember(std::vector<std::string>(words.begin(), words.end())))
      ->default_str(std::string(standard));
}

}  // namespace anchord::cli
