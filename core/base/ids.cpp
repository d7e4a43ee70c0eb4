#include "core/base/ids.hpp"

#include <charconv>
#include <cstdio>
#include <random>

#include "core/base/text.hpp"

namespace anchord {

Uuid make_uuid_v7(UtcTime now) {
  thread_local std::random_device random;
  Uuid id;
  const auto ms = static_cast<std::uint64_t>(now.ns / 1'000'000);
  for (std::size_t i = 0; i < 6; ++i) id.bytes[i] = static_cast<std::uint8_t>(ms >> (40 - 8 * i));
  for (std::size_t i = 6; i < 16; i += 2) {
    const auto bits = random();
    id.bytes[i] = static_cast<std::uint8_t>(bits);
    id.bytes[i + 1] = static_cast<std::uint8_t>(bits >> 8);
  }
  id.bytes[6] = static_cast<std::uint8_t>((id.bytes[6] & 0x0f) | 0x70);
  id.bytes[8] = static_cast<std::uint8_t>((id.bytes[8] & 0x3f) | 0x80);
  return id;
}

std::string to_string(const Uuid& id) {
  static constexpr char k_hex[] = "0123456789abcdef";
  std::string text;
  text.reserve(36);
  for (std::size_t i = 0; i < 16; ++i) {
    if (i == 4 || i == 6 || i == 8 || i == 10) text.push_back('-');
    text.push_back(k_hex[id.bytes[i] >> 4]);
    text.push_back(k_hex[id.bytes[i] & 0x0f]);
  }
  return text;
}

Result<Uuid> parse_uuid(std::string_view text) {
  const auto bad = [&] {
    return make_error(Errc::invalid_argument, "'" + to_utf8(text, 40) + "' is not a UUID");
  };
  if (text.size() != 36) return bad();
  Uuid id;
  std::size_t nibble = 0;
  for (std::size_t i = 0; i < 36; ++i) {
    const char c = text[i];
    if (i == 8 || i == 13 || i == 18 || i == 23) {
      if (c != '-') return bad();
      continue;
    }
    int value = 0;
    if (c >= '0' && c <= '9') {
      value = c - '0';
    } else if (c >= 'a' && c <= 'f') {
      value = c - 'a' + 10;
    } else if (c >= 'A' && c <= 'F') {
      value = c - 'A' + 10;
    } else {
      return bad();
    }
    auto& byte = id.bytes[nibble / 2];
    byte = static_cast<std::uint8_t>(nibble % 2 == 0 ? value << 4 : byte | value);
    ++nibble;
  }
  return id;
}

std::string to_string(NetworkId id) {
  char text[16];
  std::snprintf(text, sizeof text, "0x%04x", static_cast<unsigned>(id.value));
  return text;
}

Result<NetworkId> parse_network_id(std::string_view text) {
  const bool hex = text.size() > 2 && text[0] == '0' && (text[1] == 'x' || text[1] == 'X');
  const std::string_view digits = hex ? text.substr(2) : text;
  NetworkId id;
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), id.value, hex ? 16 : 10);
  if (digits.empty() || error != std::errc{} || end != digits.data() + digits.size()) {
    return make_error(
        Errc::invalid_argument,
        "'" + to_utf8(text, 40) + "' is not a network id like 0x6a2f or 27183 (32 bits at most)");
  }
  return id;
}

}  // namespace anchord
