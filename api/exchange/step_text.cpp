#include "api/exchange/step_text.hpp"

#include <cstdint>
#include <cstdio>

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

/// Alphabet of IFC's base 64, which is not the one of RFC 4648.
constexpr std::string_view k_guid_digits = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_$";
constexpr std::size_t k_guid_length = 22, k_most_characters = 255;

/// The character at `i` of valid UTF-8, and `i` behind it.
char32_t next_character(std::string_view utf8, std::size_t& i) {
  const auto byte = static_cast<unsigned char>(utf8[i++]);
  if (byte < 0x80) return byte;
  const int more = byte >= 0xf0 ? 3 : byte >= 0xe0 ? 2 : 1;
  char32_t code = byte & (0x3fU >> more);
  for (int k = 0; k < more && i < utf8.size(); ++k)
    code = (code << 6) | (static_cast<unsigned char>(utf8[i++]) & 0x3fU);
  return code;
}

std::string escaped(char32_t code) {
  char out[24];
  std::snprintf(out, sizeof out, code > 0xffff ? "\\X4\\%08X\\X0\\" : "\\X2\\%04X\\X0\\",
                static_cast<unsigned>(code));
  return out;
}

}  // namespace

std::string step::text(std::string_view utf8) {
  const std::string valid = to_utf8(utf8);
  std::string out = "'";
  std::size_t characters = 0;
  for (std::size_t i = 0; i < valid.size() && characters < k_most_characters; ++characters) {
    const char32_t code = next_character(valid, i);
    if (code < 0x20 || code == 0x7f)
      out += ' ';
    else if (code > 0x7f)
      out += escaped(code);
    else if (code == '\'' || code == '\\')
      out.append(2, static_cast<char>(code));
    else
      out += static_cast<char>(code);
  }
  return out + '\'';
}

std::string step::text_or_null(std::string_view utf8) { return utf8.empty() ? "$" : text(utf8); }

std::string step::real(double value) {
  char out[64];
  std::snprintf(out, sizeof out, "%.4f", value);
  return out;
}

std::string step::list(const std::vector<std::string>& references) {
  std::string out = "(";
  for (const auto& one : references) {
    if (out.size() > 1) out += ',';
    out += one;
  }
  return out + ')';
}

std::string step::guid(const Uuid& id) {
  std::string out;
  unsigned value = 0;
  int bits = 4;  // 132 bits in 22 characters: the first has four zeros before its two
  for (const auto byte : id.bytes) {
    value = (value << 8) | byte;
    bits += 8;
    while (bits >= 6) {
      bits -= 6;
      out += k_guid_digits[(value >> bits) & 0x3f];
    }
  }
  return out;
}

bool step::is_guid(std::string_view text) {
  return text.size() == k_guid_length && text[0] >= '0' && text[0] <= '3' &&
         text.find_first_not_of(k_guid_digits) == std::string_view::npos;
}

std::string StepData::add(std::string_view name, std::string_view values) {
  std::string reference = '#' + std::to_string(++last_);
  instances_.append(reference).append("=").append(name).append("(").append(values).append(");\r\n");
  return reference;
}

}  // namespace anchord::api
