#pragma once

#include <functional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace anchord::cli {

/// The words of a table for CLI::IsMember.
template <class T, std::size_t N>
std::vector<std::string> words_of(const EnumTable<T, N>& table) {
  return {table.words().begin(), table.words().end()};
}

/// An option that takes one of the words and hands it to `set`. `standard` is shown in the help.
CLI::Option* add_word(CLI::App& command, const std::string& name, std::span<const std::string_view> words,
                      std::string_view standard, std::function<void(const std::string&)> set,
                      const std::string& help);

/// An option that takes one word of the table and sets `value`, which has its default and outlives the
/// command. `table` is a constant of the program.
template <class T, std::size_t N>
CLI::Option* add_word(CLI::App& command, const std::string& name, T& value, const EnumTable<T, N>& table,
                      const std::string& help) {
  return add_word(
      command, name, table.words(), table.word(value),
      [&value, &table](const std::string& word) { value = table.find(word).value_or(value); }, help);
}

}  // namespace anchord::cli
