#include "api/formats/class_words.hpp"

#include <algorithm>

#include "api/formats/cells.hpp"
#include "api/formats/column_names.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

using columns::bare_name;

enum class Word { los, nlos, yes, no, number, other };

Word word_of(std::string_view cell) {
  const auto plain = bare_name(cell);
  if (const auto number = cell_number(cell))
    return *number == 1 ? Word::yes : *number == 0 ? Word::no : Word::number;
  if (plain == "true" || plain == "yes") return Word::yes;
  if (plain == "false" || plain == "no") return Word::no;
  if (plain == "los") return Word::los;
  // "DP NLOS" and "NDP NLOS" are both NLOS; "non LOS" is not LOS.
  for (std::size_t at = 0; at < cell.size();) {
    const auto end = std::min(cell.find_first_of(" _-/", at), cell.size());
    if (bare_name(cell.substr(at, end - at)) == "nlos") return Word::nlos;
    at = end + 1;
  }
  return Word::other;
}

bool same(std::string_view a, std::string_view b) {
  const auto x = cell_number(a), y = cell_number(b);
  return x && y ? *x == *y : a == b;
}

bool named_nlos(std::string_view column) { return bare_name(column).ends_with("nlos"); }

}  // namespace

bool ClassReader::says_it(std::string_view column) {
  const auto name = bare_name(column);
  return name == "los" || name == "islos" || name == "nlos" || name == "isnlos";
}

ClassReader::Said ClassReader::read(std::string_view column, std::string_view cell) {
  const auto as = [&](bool los, std::string_view value) {
    if (los) taken_.insert_or_assign(std::string(column), std::string(value));
    // Without a row of LOS the report still says what would have been one.
    if (!los) taken_.try_emplace(std::string(column), std::string(value));
    return los ? Said::los : Said::nlos;
  };
  if (says_nothing(cell)) return Said::nothing;
  const bool by_value = !los_value_.empty() && (always_ || !says_it(column));
  const auto word = word_of(cell);
  if (by_value) {
    const bool los = same(cell, los_value_);
    met_ = met_ || los;
    if (los || (word != Word::los && word != Word::nlos)) return as(los, los_value_);
  }
  if (word == Word::los || word == Word::nlos) return as(word == Word::los, word == Word::los ? cell : "LOS");
  if (!says_it(column)) return word == Word::other ? Said::unreadable : Said::untold;
  if (word != Word::yes && word != Word::no) return Said::unreadable;
  const bool los = (word == Word::yes) != named_nlos(column);
  return as(los, los ? cell : named_nlos(column) ? "0" : "1");
}

std::string untold_class(std::string_view column, std::string_view cell) {
  const auto quoted = [](std::string_view text) { return '"' + to_utf8(text, 40) + '"'; };
  return "column " + quoted(column) + " has " + quoted(cell) +
         " and does not say which value is LOS: name the value that is (--los-value, over REST los_value), "
         "or rename the column to los (1 is LOS) or nlos (1 is NLOS)";
}

}  // namespace anchord::api
