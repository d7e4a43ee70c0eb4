#include "api/mqtt/topic_name.hpp"

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_most_prefix = 200;

void append_hex(std::string& out, std::string_view bytes) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    out += '%';
    out += digits[byte >> 4];
    out += digits[byte & 15];
  }
}

std::size_t length_of(char first) {
  const auto byte = static_cast<unsigned char>(first);
  return byte < 0x80 ? 1 : byte < 0xe0 ? 2 : byte < 0xf0 ? 3 : 4;
}

/// MQTT 3.1.1 section 1.5.3: brokers may close on control characters and non-characters, and mosquitto does.
/// Of the latter a few neighbours go too: what ends in BF BE or BF BF.
bool kept(std::string_view character) {
  const auto at = [&](std::size_t i) { return static_cast<unsigned char>(character[i]); };
  const std::size_t n = character.size();
  if (n == 1)
    return at(0) >= 0x20 && at(0) != 0x7f &&
           std::string_view("/+#%~").find(character) == std::string_view::npos;
  if (n == 2) return at(0) != 0xc2 || at(1) >= 0xa0;
  if (n == 3 && at(0) == 0xef && at(1) == 0xb7) return false;
  return at(n - 2) != 0xbf || at(n - 1) < 0xbe;
}

}  // namespace

std::string topic_level(std::string_view name) {
  const std::string text = to_utf8(name);
  std::string out;
  for (std::size_t i = 0; i < text.size();) {
    const auto character = std::string_view(text).substr(i, length_of(text[i]));
    if (kept(character) && (i > 0 || (character != "_" && character != "$")))
      out += character;
    else
      append_hex(out, character);
    i += character.size();
  }
  return out.empty() ? "%" : out;
}

std::string wrong_prefix(std::string_view prefix) {
  if (prefix.empty() || prefix.size() > k_most_prefix)
    return "must have 1 to " + std::to_string(k_most_prefix) + " bytes";
  std::string_view rest = prefix;
  while (true) {
    const auto level = rest.substr(0, rest.find('/'));
    if (level.empty()) return "must not begin or end with '/', or have '//'";
    if (topic_level(level) != level)
      return "must be levels of an MQTT topic, without '+', '#', '%', '~', control characters, or '$' and "
             "'_' "
             "at the beginning of a level";
    if (level.size() == rest.size()) return {};
    rest.remove_prefix(level.size() + 1);
  }
}

}  // namespace anchord::api
