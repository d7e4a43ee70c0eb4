#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string_view>
#include <vector>

#include "api/kit/reader.hpp"

namespace anchord::api {

/// A word of the wire beside the value it stands for: neither an enum nor a list of words can be reordered
/// without the other.
template <class T>
struct Word {
  std::string_view word;
  T value;
};

template <class T, std::size_t N>
std::vector<std::string_view> words_of(const std::array<Word<T>, N>& table) {
  std::vector<std::string_view> words;
  words.reserve(N);
  for (const auto& row : table) words.push_back(row.word);
  return words;
}

/// Empty for a value that the table does not have.
template <class T, std::size_t N>
constexpr std::string_view word_of(const std::array<Word<T>, N>& table, T value) {
  for (const auto& row : table)
    if (row.value == value) return row.word;
  return "";
}

template <class T, std::size_t N>
constexpr std::optional<T> value_of(const std::array<Word<T>, N>& table, std::string_view word) {
  for (const auto& row : table)
    if (row.word == word) return row.value;
  return std::nullopt;
}

/// The value of a field that is one of the words of the table; errors as of Fields::word.
template <class T, std::size_t N>
std::optional<T> value_of_word(Fields& fields, std::string_view key, const std::array<Word<T>, N>& table,
                               bool required = false) {
  const auto at = fields.word(key, words_of(table), required);
  if (!at) return std::nullopt;
  return table[*at].value;
}

}  // namespace anchord::api
