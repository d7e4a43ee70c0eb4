#include "api/formats/cells.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

namespace anchord::api {
namespace {

std::optional<double> plain_number(std::string_view cell) {
  double value{};
  const auto [end, status] = std::from_chars(cell.data(), cell.data() + cell.size(), value);
  if (status != std::errc{} || end != cell.data() + cell.size() || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

char separator_of(std::string_view header) {
  char best = ',';
  for (const char c : {';', '\t'})
    if (std::count(header.begin(), header.end(), c) > std::count(header.begin(), header.end(), best))
      best = c;
  return best;
}

char separator_named_by(std::string_view line) {
  if (line.ends_with('\r')) line.remove_suffix(1);
  if (line.size() == 7 && line.starts_with('"') && line.ends_with('"')) line = line.substr(1, 5);
  return line.size() == 5 && lower_case(line.substr(0, 4)) == "sep=" ? line[4] : '\0';
}

std::string lower_case(std::string_view text) {
  std::string out(text);
  std::ranges::transform(out, out.begin(),
                         [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; });
  return out;
}

std::string listed_briefly(std::span<const std::string> names) {
  constexpr std::size_t k_enough = 400;
  std::string out;
  for (const auto& name : names) {
    if (out.size() > k_enough) return out + ", ...";
    out += (out.empty() ? "" : ", ") + name;
  }
  return out;
}

std::optional<double> cell_number(std::string_view cell, bool decimal_comma) {
  if (!decimal_comma || cell.find(',') == std::string_view::npos) return plain_number(cell);
  // "1.234,5" and "1,234,567" mean something else in every country: no number.
  if (cell.find('.') != std::string_view::npos || cell.find(',') != cell.rfind(',')) return std::nullopt;
  std::string pointed{cell};
  pointed[pointed.find(',')] = '.';
  return plain_number(pointed);
}

bool says_nothing(std::string_view cell) {
  constexpr std::array<std::string_view, 7> k_words{"", "nan", "na", "n/a", "null", "none", "-"};
  const std::string word = lower_case(cell);
  return std::find(k_words.begin(), k_words.end(), word) != k_words.end();
}

std::string wrong_cell_count(std::size_t cells, std::size_t expected, char separator) {
  std::string out = std::to_string(cells) + " cells, the header has " + std::to_string(expected);
  if (separator == ',' && cells > expected)
    out += " (with decimal commas, separate the cells by semicolons or tabs; else write decimal points)";
  return out;
}

}  // namespace anchord::api
