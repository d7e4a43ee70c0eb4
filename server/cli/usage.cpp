#include "server/cli/usage.hpp"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <filesystem>
#include <numeric>
#include <optional>
#include <string_view>
#include <system_error>
#include <vector>

namespace anchord::cli {
namespace {

/// Insertions, deletions, replacements and exchanged neighbours (restricted Damerau-Levenshtein).
std::size_t distance(std::string_view a, std::string_view b) {
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i) d[i][0] = i;
  std::iota(d[0].begin(), d[0].end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t other = a[i - 1] == b[j - 1] ? 0 : 1;
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + other});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  }
  return d[a.size()][b.size()];
}

std::optional<std::string> nearest(const std::string& word, const std::vector<std::string>& known) {
  std::optional<std::string> best;
  std::size_t least = 1 + std::min<std::size_t>(3, word.size() / 3);
  for (const auto& one : known) {
    const bool begun = word.size() >= 4 && one.starts_with(word);
    const auto d = begun ? 1 : distance(word, one);
    if (d < least) {
      least = d;
      best = one;
    }
  }
  return best;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> out;
  for (const auto* sub : app.get_subcommands([](const CLI::App*) { return true; }))
    if (!sub->get_group().empty()) out.push_back(sub->get_name());
  return out;
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> out;
  for (const auto* option : app.get_options())
    for (const auto& name : option->get_lnames()) out.push_back("--" + name);
  return out;
}

std::string wrong(const std::string& kind, const std::string& word, const std::string& command,
                  const std::vector<std::string>& known) {
  std::string out = "there is no " + kind + " '" + word + "'";
  if (!command.empty()) out += " of " + command;
  if (const auto meant = nearest(word, known)) out += "; did you mean '" + *meant + "'?";
  return out;
}

}  // namespace

std::string unknown_word(const CLI::App& app, std::span<const char* const> arguments) {
  const CLI::App* at = &app;
  std::string command;
  for (std::size_t i = 0; i < arguments.size(); ++i) {
    const std::string word = arguments[i];
    if (word == "--") return {};
    if (word.starts_with("--")) {
      const auto name = word.substr(0, word.find('='));
      const auto* option = at->get_option_no_throw(name);
      if (option == nullptr) return wrong("option", name, command, option_names(*at));
      if (name.size() == word.size() && option->get_items_expected_min() > 0) ++i;
      continue;
    }
    if (word.starts_with("-")) continue;
    const auto named = at->get_subcommands([&](const CLI::App* sub) { return sub->check_name(word); });
    if (!named.empty()) {
      at = named.front();
      command += (command.empty() ? "" : " ") + word;
      continue;
    }
    const bool takes_words =
        std::ranges::any_of(at->get_options(), [](const auto* o) { return o->get_positional(); });
    // A slip in a command is no file: "simulate flihgt".
    const auto commands = command_names(*at);
    std::error_code ignored;
    const bool names_a_file =
        word.find_first_of("./") != std::string::npos || std::filesystem::exists(word, ignored);
    if (takes_words && (names_a_file || !nearest(word, commands))) continue;
    return wrong("command", word, command, commands);
  }
  return {};
}

}  // namespace anchord::cli
