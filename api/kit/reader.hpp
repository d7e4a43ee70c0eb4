#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/base/enum_table.hpp"

namespace anchord::api {

/// Deepest nesting of arrays and objects in any request.
inline constexpr int k_max_json_depth = 32;

/// Parses one JSON document. Refused, each with its own code and never half-read: broken syntax
/// (`malformed`), broken UTF-8 (`bad_utf8`), nesting beyond 32 (`too_deep`), a key twice in one object
/// (`duplicate_key`), numbers that are no finite double, NaN and Infinity (`non_finite`). Never throws.
std::optional<FieldError> parse_json(std::string_view text, nlohmann::json& out);

/// Reads the fields of one object and collects everything that is wrong with them, each with its JSON
/// pointer. Every getter marks its key as known; finish() reports the rest as unknown_field. null counts as
/// absent.
class Fields {
 public:
  Fields(const nlohmann::json& value, std::string base, std::vector<FieldError>& errors);

  /// False when the value is not an object (reported); getters then give nothing.
  bool is_object() const { return object_ != nullptr; }
  bool has(std::string_view key) const;
  /// The raw member, marked as known; null when absent or JSON null.
  const nlohmann::json* child(std::string_view key);
  std::string pointer(std::string_view key) const;

  std::optional<double> number(std::string_view key, double min, double max, bool required = false);
  std::optional<std::int64_t> integer(std::string_view key, std::int64_t min, std::int64_t max,
                                      bool required = false);
  std::optional<std::string> text(std::string_view key, std::size_t max_bytes, bool required = false);
  std::optional<bool> boolean(std::string_view key);
  /// An array of exactly n finite numbers.
  std::optional<std::vector<double>> numbers(std::string_view key, std::size_t n, double min, double max,
                                             bool required = false);
  /// The value of a word of the table.
  template <class T, std::size_t N>
  std::optional<T> word(std::string_view key, const EnumTable<T, N>& table, bool required = false) {
    const std::string* word = one_of(key, table.words(), required);
    return word == nullptr ? std::nullopt : table.find(*word);
  }
  /// One of the given words, itself.
  std::optional<std::string> word(std::string_view key, std::span<const std::string_view> words,
                                  bool required = false) {
    const std::string* word = one_of(key, words, required);
    return word == nullptr ? std::nullopt : std::optional(*word);
  }

  /// Of a field where null says something, and leaving it out does not say the same.
  void must_be_named(std::string_view key);
  void error(std::string_view key, std::string code, std::string detail);
  void finish();

 private:
  const std::string* one_of(std::string_view key, std::span<const std::string_view> words, bool required);
  std::optional<double> finite(const nlohmann::json& value, const std::string& at, double min, double max);
  const nlohmann::json* object_{nullptr};
  std::string base_;
  std::vector<FieldError>& errors_;
  std::set<std::string, std::less<>> known_;
};

/// Content-Type without its parameters, lower case: media types have no case (RFC 9110 section 8.3.1).
std::string media_type(const Request& request);

/// The parsed body of an ordinary JSON request. Throws ProblemException: 415 without application/json (or
/// merge-patch), 400 where it cannot be read. An empty body reads as {} when `may_be_empty`.
nlohmann::json json_body(const Request& request, bool may_be_empty = false);
/// JSON that is kept as text; null where it is empty or cannot be read, so that it never spoils an answer.
nlohmann::ordered_json kept_json(std::string_view text);
/// The body of a route that takes a file as it is (CSV, KML, a model): UTF-8, or 400.
const std::string& text_body(const Request& request);

/// Throws the 422 that lists `errors`, unless there are none.
void refuse_if_any(const std::vector<FieldError>& errors);

}  // namespace anchord::api
