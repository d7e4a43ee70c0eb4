#include "server/cli/text_table.hpp"

#include <algorithm>
#include <array>
#include <cstdint>

#include "core/base/text.hpp"

namespace anchord::cli {
namespace {

constexpr std::size_t k_gap = 2;
constexpr std::size_t k_narrowest = 6;  ///< of a column that shrinks: three characters and "..."
constexpr std::size_t k_widest = 40;    ///< of a column that others follow

struct Span {
  std::uint32_t first, last;
  bool has(std::uint32_t c) const { return c >= first && c <= last; }
};

// Unicode 15: Bidi_Control, separators of lines, and what has no width and no ink.
constexpr std::array k_unseen{Span{0x00ad, 0x00ad}, Span{0x061c, 0x061c},  Span{0x200b, 0x200f},
                              Span{0x2028, 0x202e}, Span{0x2060, 0x206f},  Span{0xfeff, 0xfeff},
                              Span{0xfff9, 0xfffb}, Span{0xe0000, 0xe007f}};
// Unicode 15: the blocks of combining marks and variation selectors.
constexpr std::array k_combining{Span{0x0300, 0x036f}, Span{0x1ab0, 0x1aff}, Span{0x1dc0, 0x1dff},
                                 Span{0x20d0, 0x20ff}, Span{0xfe00, 0xfe0f}, Span{0xfe20, 0xfe2f}};
// Unicode 15, EastAsianWidth.txt: the blocks that are Wide or Fullwidth.
constexpr std::array k_wide{Span{0x1100, 0x115f},   Span{0x2e80, 0x303e},   Span{0x3041, 0xa4cf},
                            Span{0xac00, 0xd7a3},   Span{0xf900, 0xfaff},   Span{0xfe30, 0xfe6f},
                            Span{0xff00, 0xff60},   Span{0xffe0, 0xffe6},   Span{0x1f300, 0x1f64f},
                            Span{0x1f680, 0x1f6ff}, Span{0x1f900, 0x1f9ff}, Span{0x20000, 0x3fffd}};

template <std::size_t N>
bool in(const std::array<Span, N>& spans, std::uint32_t c) {
  return std::ranges::any_of(spans, [c](const Span& span) { return span.has(c); });
}

struct Character {
  std::uint32_t code{};
  std::size_t bytes{1};
};

/// The first character of well-formed UTF-8 that is not empty.
Character first_of(std::string_view text) {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<std::uint32_t>(static_cast<unsigned char>(text[i])) : 0U;
  };
  const std::uint32_t lead = byte(0);
  if (lead < 0xc0) return {lead, 1};
  if (lead < 0xe0) return {((lead & 0x1fU) << 6) | (byte(1) & 0x3fU), 2};
  if (lead < 0xf0) return {((lead & 0x0fU) << 12) | ((byte(1) & 0x3fU) << 6) | (byte(2) & 0x3fU), 3};
  return {((lead & 0x07U) << 18) | ((byte(1) & 0x3fU) << 12) | ((byte(2) & 0x3fU) << 6) | (byte(3) & 0x3fU),
          4};
}

std::size_t columns_of_one(std::uint32_t c) {
  if (in(k_combining, c)) return 0;
  return in(k_wide, c) ? 2 : 1;
}

/// The longest beginning of at most so many columns.
std::string_view beginning(std::string_view utf8, std::size_t columns) {
  std::size_t at = 0, used = 0;
  while (at < utf8.size()) {
    const auto c = first_of(utf8.substr(at));
    used += columns_of_one(c.code);
    if (used > columns) break;
    at += c.bytes;
  }
  return utf8.substr(0, at);
}

/// Takes columns from the widest that may shrink until the line fits or nothing is left to take.
void shrink(std::vector<std::size_t>& widths, const std::vector<Column>& columns, std::size_t width) {
  std::size_t total = k_gap * (widths.size() - 1);
  for (const auto w : widths) total += w;
  while (total > width) {
    std::size_t* widest = nullptr;
    for (std::size_t i = 0; i < widths.size(); ++i)
      if (columns[i].may_shrink && (widest == nullptr || widths[i] > *widest)) widest = &widths[i];
    if (widest == nullptr || *widest <= k_narrowest) return;
    --*widest;
    --total;
  }
}

std::string line_of(const std::vector<std::string>& cells, const std::vector<std::size_t>& widths,
                    const std::vector<Column>& columns) {
  std::string out;
  for (std::size_t i = 0; i < cells.size() && i < widths.size(); ++i) {
    const auto cell = cut_to(cells[i], widths[i]);
    const std::string space(widths[i] - columns_of(cell), ' ');
    if (i > 0) out.append(k_gap, ' ');
    out += columns[i].is_number ? space + cell : cell + space;
  }
  out.erase(out.find_last_not_of(' ') + 1);
  return out;
}

}  // namespace

std::string one_line(std::string_view text) {
  const std::string utf8 = to_utf8(text);
  std::string seen;  // "?" is shorter in a table than the code that printable() makes
  for (std::size_t at = 0; at < utf8.size();) {
    const auto c = first_of(std::string_view(utf8).substr(at));
    if (in(k_unseen, c.code))
      seen += '?';
    else
      seen += utf8.substr(at, c.bytes);
    at += c.bytes;
  }
  std::string out = printable(seen);
  std::ranges::replace_if(
      out, [](char c) { return c == '\n' || c == '\t'; }, ' ');
  return out;
}

std::string printable_json(std::string_view json) {
  const std::string utf8 = to_utf8(json);
  std::string out;
  out.reserve(utf8.size());
  for (std::size_t at = 0; at < utf8.size();) {
    const auto character =
        std::string_view(utf8).substr(at, first_of(std::string_view(utf8).substr(at)).bytes);
    at += character.size();
    if (character.size() == 1)  // what is laid out between values stays
      out += character;
    else if (const auto escaped = json_text(character); escaped.size() > 6)
      out += escaped.substr(1, escaped.size() - 2);
    else
      out += character;
  }
  return out;
}

std::size_t columns_of(std::string_view utf8) {
  std::size_t columns = 0;
  for (std::size_t at = 0; at < utf8.size();) {
    const auto c = first_of(utf8.substr(at));
    columns += columns_of_one(c.code);
    at += c.bytes;
  }
  return columns;
}

std::string cut_to(std::string_view utf8, std::size_t columns) {
  if (columns_of(utf8) <= columns) return std::string(utf8);
  if (columns <= 3) return std::string(beginning(utf8, columns));
  return std::string(beginning(utf8, columns - 3)) + "...";
}

std::vector<std::string> table_lines(const std::vector<Column>& columns,
                                     const std::vector<std::vector<std::string>>& rows, std::size_t width) {
  if (columns.empty()) return {};
  std::vector<std::vector<std::string>> all(1);
  for (const auto& column : columns) all.front().push_back(column.title);
  for (const auto& row : rows) {
    auto& clean = all.emplace_back();
    for (const auto& cell : row) clean.push_back(one_line(cell));
  }
  std::vector<std::size_t> widths(columns.size());
  for (const auto& row : all)
    for (std::size_t i = 0; i < row.size() && i < widths.size(); ++i) {
      const auto wanted = columns_of(row[i]);
      widths[i] = std::max(widths[i], i + 1 < widths.size() ? std::min(wanted, k_widest) : wanted);
    }
  if (width > 0) shrink(widths, columns, width);
  std::vector<std::string> out;
  for (const auto& row : all) {
    const auto line = line_of(row, widths, columns);
    out.push_back(width > 0 ? cut_to(line, width) : line);
  }
  return out;
}

}  // namespace anchord::cli
