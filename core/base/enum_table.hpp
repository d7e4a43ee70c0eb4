#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "core/base/result.hpp"

namespace anchord {

/// A word beside the value it is for.
template <class T>
struct Word {
  std::string_view word;
  T value;
};

/// "a, b, c".
std::string list_of(std::span<const std::string_view> words);
/// 'unknown NAME "word": must be one of a, b, c'. `word` comes from outside.
Error unknown_word(std::string_view name, std::string_view word, std::span<const std::string_view> words);

namespace detail {

/// Whether a value of an enum is one of its enumerators. There is no reflection in C++20; g++ and clang write
/// a template argument as its enumerator, and as "(Enum)7" where there is none.
template <auto Value>
consteval bool is_enumerator() {
  constexpr std::string_view text = __PRETTY_FUNCTION__;
  return text[text.find("Value = ") + 8] != '(';
}

}  // namespace detail

/// The words of an enum, each spelled once, for JSON, SQL, the command line, messages and the check against
/// the contract. It is in the header of the enum, made by enum_table():
///
///   enum class Loss : std::uint8_t { none, huber };
///   inline constexpr auto k_loss_words = enum_table<Loss>({{"none", Loss::none}, {"huber", Loss::huber}});
///
/// Neither the enum nor its table can be reordered or grow without the other: a word twice, a value twice, no
/// word, or an enumerator that has none (of those counted from 0 without a gap) does not compile. T may be
/// another type than an enum: {{"auto", false}, {"manual", true}}.
template <class T, std::size_t N>
class EnumTable {
 public:
  consteval explicit EnumTable(const Word<T> (&rows)[N])
      : EnumTable(rows, std::make_index_sequence<N>{}, std::make_index_sequence<N + 1>{}) {}

  static constexpr std::size_t size() { return N; }
  constexpr const Word<T>* begin() const { return rows_; }
  constexpr const Word<T>* end() const { return rows_ + N; }
  constexpr std::span<const std::string_view> words() const { return words_; }

  /// Throws std::logic_error for a value that is none of the enum's: somebody cast a number to it.
  constexpr std::string_view word(T value) const {
    for (const auto& row : rows_)
      if (row.value == value) return row.word;
    throw std::logic_error("a value of an enum that has no word");
  }

  constexpr std::optional<T> find(std::string_view word) const {
    for (const auto& row : rows_)
      if (row.word == word) return row.value;
    return std::nullopt;
  }

  /// The value with this number, which is what the database has in its place; the migrations say which is
  /// which.
  constexpr std::optional<T> of_number(std::int64_t number) const requires std::is_enum_v<T> {
    for (const auto& row : rows_)
      if (static_cast<std::int64_t>(row.value) == number) return row.value;
    return std::nullopt;
  }

  /// `name`: of what the word was given for, in the error.
  /// errors  invalid_argument, with the words that may be used
  Result<T> parse(std::string_view name, std::string_view word) const {
    if (const auto value = find(word)) return *value;
    return unknown_word(name, word, words_);
  }

 private:
  template <std::size_t... I, std::size_t... J>
  consteval EnumTable(const Word<T> (&rows)[N], std::index_sequence<I...>, std::index_sequence<J...>)
      : rows_{rows[I]...}, words_{rows[I].word...} {
    for (std::size_t i = 0; i < N; ++i) {
      if (rows_[i].word.empty()) throw std::logic_error("an empty word");
      for (std::size_t k = 0; k < i; ++k) {
        if (rows_[i].word == rows_[k].word) throw std::logic_error("a word twice");
        if (rows_[i].value == rows_[k].value) throw std::logic_error("a value twice");
      }
    }
    // One more than there are rows: an enum that has grown by one is seen.
    if constexpr (std::is_enum_v<T>) (require<static_cast<T>(J)>(), ...);
  }

  template <T Value>
  consteval void require() const {
    if constexpr (detail::is_enumerator<Value>()) (void)word(Value);
  }

  Word<T> rows_[N];
  std::string_view words_[N];
};

template <class T, std::size_t N>
consteval EnumTable<T, N> enum_table(const Word<T> (&rows)[N]) {
  return EnumTable<T, N>(rows);
}

}  // namespace anchord
