#include "api/formats/foreign_meaning.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <set>

namespace anchord::api {
namespace {

bool is_hex(std::string_view text) {
  return text.size() >= 4 && text.size() <= 16 &&
         text.find_first_not_of("0123456789abcdefABCDEF") == std::string_view::npos;
}
bool has_letter(std::string_view text) {
  return text.find_first_of("abcdefABCDEF") != std::string_view::npos;
}

bool is_name_of(std::string_view field, const std::string& name) {
  const auto known = std::ranges::find(k_foreign_fields, field, &FieldNames::field);
  return !name.empty() && contains(' ' + std::string(known->names) + ' ', ' ' + name + ' ');
}

/// The values of a column that occur, but for nothing at all; of a column of many, some.
std::set<std::string> words_in(const ForeignTable& table, std::size_t column) {
  std::set<std::string_view> cells;
  for (std::size_t row = 0; row < table.n_rows() && cells.size() < 20; ++row)
    cells.insert(table.cell(row, column));
  std::set<std::string> out;
  for (const auto cell : cells)
    if (!cell.empty()) out.insert(plain_name(cell));
  return out;
}

constexpr std::string_view k_metres = " m metre metres meter meters ", k_centimetres = " cm ",
                           k_millimetres = " mm ",
                           k_others = " ft feet foot f us_ft usft ft_us in inch inches yd km mi nmi ";

bool is_in(std::string_view words, const std::string& word) { return contains(words, ' ' + word + ' '); }

}  // namespace

std::optional<HeadingKind> heading_kind(const ForeignTable& table, std::string_view column) {
  const auto at = table.column(column);
  if (!at || plain_name(column).ends_with("_deg")) return HeadingKind::deg;
  bool any = false;
  for (std::size_t row = 0; row < table.n_rows(); ++row) {
    const double value = table.number(table.cell(row, *at));
    if (std::abs(value) > 2 * std::numbers::pi) return HeadingKind::deg;
    any = any || std::isfinite(value);
  }
  return any ? std::nullopt : std::optional(HeadingKind::deg);
}

double north_deg(double value, HeadingKind kind) {
  const bool radians = kind == HeadingKind::rad || kind == HeadingKind::rad_from_east;
  const bool from_east = kind == HeadingKind::deg_from_east || kind == HeadingKind::rad_from_east;
  const double degrees = radians ? value * 180 / std::numbers::pi : value;
  return std::fmod(std::fmod(from_east ? 90 - degrees : degrees, 360) + 360, 360);
}

bool has_thousands(const ForeignTable& table, std::string_view column) {
  constexpr std::size_t k_group = 3;
  bool separated = false;
  for (const auto cell : table.sample(column)) {
    if (cell.empty()) continue;
    const auto head = std::min(cell.find_first_of(".,"), cell.size());
    if (head == 0 || head > k_group || (cell.size() - head) % (k_group + 1) != 0) return false;
    for (std::size_t i = 0; i < cell.size(); ++i) {
      const bool at_separator = i >= head && (i - head) % (k_group + 1) == 0;
      if (at_separator ? cell[i] != '.' && cell[i] != ',' : cell[i] < '0' || cell[i] > '9') return false;
    }
    separated = separated || head < cell.size();
  }
  return separated;
}

bool may_be_hexadecimal(const ForeignTable& table, std::string_view column, std::string_view given) {
  bool letter = is_hex(given) && has_letter(given);
  const auto at = table.column(column);
  for (std::size_t row = 0; at && row < table.n_rows(); ++row) {
    const auto cell = table.cell(row, *at);
    if (cell.empty()) continue;
    if (!is_hex(cell)) return false;
    letter = letter || has_letter(cell);
  }
  return letter;
}

ForeignId foreign_id(std::string_view text, AddressKind kind) {
  if (kind == AddressKind::hex && is_hex(text)) {
    if (const auto id = parse_network_id("0x" + std::string(text))) return {id.value(), false};
  }
  return foreign_id(text);
}

std::optional<std::string> hemisphere_column(const ForeignTable& table, const ForeignColumns& columns,
                                             std::string_view field) {
  const bool lat = field == "lat";
  const auto used = columns.find(field);
  const auto beside = used == columns.end() ? std::nullopt : table.column(used->second);
  for (std::size_t i = 0; i < table.columns().size(); ++i) {
    const auto& name = table.columns()[i];
    if (!(beside && i == *beside + 1) &&
        !is_name_of(lat ? "lat_hemisphere" : "lon_hemisphere", plain_name(name)))
      continue;
    const auto words = words_in(table, i);
    const std::string_view letters = lat ? " n s north south " : " e w east west ";
    if (!words.empty() && std::ranges::all_of(words, [&](const auto& w) { return is_in(letters, w); }))
      return name;
  }
  return std::nullopt;
}

std::optional<int> hemisphere_sign(std::string_view cell) {
  const auto word = plain_name(cell);
  if (is_in(" n north e east ", word)) return 1;
  if (is_in(" s south w west ", word)) return -1;
  return std::nullopt;
}

std::optional<UnitColumn> unit_column(const ForeignTable& table, const ForeignColumns& columns,
                                      std::string_view field) {
  const auto used = columns.find(field);
  const auto beside = used == columns.end() ? std::nullopt : table.column(used->second);
  if (!beside) return std::nullopt;
  const auto claimed = [&](const std::string& name) {
    return std::ranges::any_of(columns, [&](const auto& c) { return c.second == name; });
  };
  for (std::size_t i = 0; i < table.columns().size(); ++i) {
    const auto& name = table.columns()[i];
    const auto plain = plain_name(name);
    const bool named = contains(plain, "unit") || contains(plain, "einheit");
    // One that stands right behind another column in use is of that one.
    if (claimed(name) || !(i == *beside + 1 || (named && !(i > 0 && claimed(table.columns()[i - 1])))))
      continue;
    const auto words = words_in(table, i);
    if (words.empty() || !std::ranges::all_of(words, [](const auto& w) {
          return is_in(k_metres, w) || is_in(k_centimetres, w) || is_in(k_millimetres, w) ||
                 is_in(k_others, w);
        }))
      continue;
    UnitColumn out{name, {}, {}};
    for (const auto& word : words) out.word += (out.word.empty() ? "" : ", ") + word;
    if (words.size() == 1) {
      const auto& word = *words.begin();
      if (is_in(k_metres, word)) out.unit = LengthUnit::m;
      if (is_in(k_centimetres, word)) out.unit = LengthUnit::cm;
      if (is_in(k_millimetres, word)) out.unit = LengthUnit::mm;
    }
    return out;
  }
  return std::nullopt;
}

std::string with_zone(std::string_view date, std::string_view zone) {
  const auto clock = date.find(':');
  const bool own = clock != std::string_view::npos &&
                   date.find_first_not_of("0123456789:.,", clock) != std::string_view::npos;
  return std::string(date) + (own || zone.empty() ? "" : ' ' + std::string(zone));
}

}  // namespace anchord::api
