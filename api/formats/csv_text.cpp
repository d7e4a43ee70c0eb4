#include "api/formats/csv_text.hpp"

#include <algorithm>

namespace anchord::api {

namespace {

/// A floor "-2" is a number, which a spreadsheet runs no formula for.
bool is_number(std::string_view text) {
  if (text.starts_with('+') || text.starts_with('-')) text.remove_prefix(1);
  return !text.empty() &&
         std::ranges::all_of(text, [](char c) { return (c >= '0' && c <= '9') || c == '.'; }) &&
         std::ranges::count(text, '.') <= 1 && text != ".";
}

}  // namespace

std::string csv_text(std::string_view text) {
  std::string out;
  // Spreadsheets run cells that begin like a formula (reliability.md section 5).
  const bool formula =
      !text.empty() && std::string_view("=+-@\t\r").find(text.front()) != std::string_view::npos;
  if (formula && !is_number(text)) out += '\'';
  out += text;
  if (out.find_first_of(",\"\r\n") == std::string::npos) return out;
  std::string quoted = "\"";
  for (const char c : out) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + '"';
}

}  // namespace anchord::api
