#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>

/// Cells as spreadsheets of different countries write them.
namespace anchord::api {

/// Comma, semicolon or tab: the one the header has most of.
char separator_of(std::string_view header);

/// What `line` names as the separator: "sep=;", which Excel reads above a header; '\0' where it does not.
char separator_named_by(std::string_view line);

/// Capitals of ASCII as small letters; all else as it is.
std::string lower_case(std::string_view text);

/// Names with commas between them, cut off after some 400 characters.
std::string listed_briefly(std::span<const std::string> names);

/// A finite number. Where cells are not separated by commas, "3,25" is three and a quarter.
std::optional<double> cell_number(std::string_view cell, bool decimal_comma = false);

/// True for what people write where there is no value: nothing, nan, na, n/a, null, none, -.
bool says_nothing(std::string_view cell);

/// Why a line of `cells` does not fit a header of `expected`, and what helps.
std::string wrong_cell_count(std::size_t cells, std::size_t expected, char separator);

}  // namespace anchord::api
