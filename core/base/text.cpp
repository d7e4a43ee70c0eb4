#include "core/base/text.hpp"

#include <algorithm>
#include <array>
#include <cstdio>

#include "core/base/line_text.hpp"

namespace anchord {
namespace {

constexpr std::string_view k_replacement = "\xef\xbf\xbd";  // U+FFFD

struct Sequence {
  std::size_t bytes{};  ///< of the character, or of the maximal subpart that is none; at least 1
  bool good{};
};

Sequence sequence_at(std::string_view text, std::size_t i) {
  const auto byte = [&](std::size_t k) { return static_cast<unsigned char>(text[k]); };
  const unsigned char lead = byte(i);
  if (lead < 0x80) return {1, true};
  std::size_t more = 0;
  unsigned char low = 0x80, high = 0xbf;  // of the second byte, Unicode table 3-7
  if (lead >= 0xc2 && lead <= 0xdf) {
    more = 1;
  } else if (lead >= 0xe0 && lead <= 0xef) {
    more = 2;
    if (lead == 0xe0) low = 0xa0;
    if (lead == 0xed) high = 0x9f;
  } else if (lead >= 0xf0 && lead <= 0xf4) {
    more = 3;
    if (lead == 0xf0) low = 0x90;
    if (lead == 0xf4) high = 0x8f;
  } else {
    return {1, false};
  }
  for (std::size_t k = 1; k <= more; ++k) {
    if (i + k >= text.size() || byte(i + k) < low || byte(i + k) > high) return {k, false};
    low = 0x80;
    high = 0xbf;
  }
  return {more + 1, true};
}

bool plain(char c) {
  const auto u = static_cast<unsigned char>(c);
  return u >= 0x20 && u < 0x7f;
}

/// U+0080 to U+009F: an eight-bit terminal takes U+009B for the beginning of an escape.
bool control(std::string_view character) {
  const auto first = static_cast<unsigned char>(character.front());
  return first < 0x20 || first == 0x7f || (first == 0xc2 && static_cast<unsigned char>(character[1]) < 0xa0);
}

/// U+202A to U+202E and U+2066 to U+2069: text behind them is read in another order than it is written.
bool turns_writing(std::string_view character) {
  if (character.size() != 3 || character[0] != '\xe2') return false;
  const auto last = static_cast<unsigned char>(character[2]);
  return (character[1] == '\x80' && last >= 0xaa && last <= 0xae) ||
         (character[1] == '\x81' && last >= 0xa6 && last <= 0xa9);
}

/// Of what control() and turns_writing() name. The last byte of a control says it all: C1 are C2 80 to C2 9F.
unsigned code_of(std::string_view character) {
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned>(static_cast<unsigned char>(character[i]));
  };
  if (character.size() < 3) return byte(character.size() - 1);
  return ((byte(0) & 0x0fU) << 12) | ((byte(1) & 0x3fU) << 6) | (byte(2) & 0x3fU);
}

void append_code(std::string& out, const char* format, std::string_view character) {
  std::array<char, 8> code{};
  std::snprintf(code.data(), code.size(), format, code_of(character));
  out += code.data();
}

}  // namespace

bool is_utf8(std::string_view bytes) {
  for (std::size_t i = 0; i < bytes.size();) {
    const auto [n, good] = sequence_at(bytes, i);
    if (!good) return false;
    i += n;
  }
  return true;
}

std::string to_utf8(std::string_view bytes, std::size_t max_bytes) {
  std::string out;
  out.reserve(std::min(bytes.size(), max_bytes));
  for (std::size_t i = 0; i < bytes.size();) {
    const auto [n, good] = sequence_at(bytes, i);
    const auto part = good ? bytes.substr(i, n) : k_replacement;
    if (part.size() > max_bytes - out.size()) break;
    out += part;
    i += n;
  }
  return out;
}

std::string printable(std::string_view bytes) {
  std::string out;
  out.reserve(bytes.size());
  for (std::size_t i = 0; i < bytes.size();) {
    const auto [n, good] = sequence_at(bytes, i);
    const auto character = bytes.substr(i, n);
    i += n;
    if (!good)
      out += k_replacement;
    else if (control(character) && character != "\n" && character != "\t")
      append_code(out, "\\x%02x", character);
    else if (turns_writing(character))
      append_code(out, "\\u%04x", character);
    else
      out += character;
  }
  return out;
}

std::size_t characters_of(std::string_view text) {
  return static_cast<std::size_t>(
      std::ranges::count_if(text, [](char c) { return (static_cast<unsigned char>(c) & 0xc0U) != 0x80; }));
}

LineFault line_fault(std::string_view text, std::size_t max_characters) {
  if (text.size() > 4 * max_characters ||
      (text.size() > max_characters && characters_of(text) > max_characters))
    return LineFault::too_long;
  const bool control =
      std::ranges::any_of(text, [](char c) { return static_cast<unsigned char>(c) < 0x20 || c == 0x7f; });
  return control ? LineFault::control_character : LineFault::none;
}

std::string in_words(LineFault fault, std::size_t max_characters) {
  if (fault == LineFault::too_long)
    return "must be at most " + std::to_string(max_characters) + " characters";
  return fault == LineFault::control_character ? "must not contain control characters" : "";
}

void append_json_text(std::string& out, std::string_view text) {
  out += '"';
  for (std::size_t i = 0; i < text.size();) {
    std::size_t end = i;
    while (end < text.size() && plain(text[end]) && text[end] != '"' && text[end] != '\\') ++end;
    out.append(text, i, end - i);
    if (end == text.size()) break;
    const auto [n, good] = sequence_at(text, end);
    const auto character = text.substr(end, n);
    i = end + n;
    if (!good)
      out += k_replacement;
    else if (character == "\"" || character == "\\")
      (out += '\\') += character;
    else if (character == "\n")
      out += "\\n";
    else if (control(character) || turns_writing(character))
      append_code(out, "\\u%04x", character);
    else
      out += character;
  }
  out += '"';
}

std::string json_text(std::string_view text) {
  std::string out;
  out.reserve(text.size() + 2);
  append_json_text(out, text);
  return out;
}

}  // namespace anchord
