#include "core/base/ids.hpp"

#include <charconv>
#include <random>

#include "core/base/locked.hpp"
#include "core/base/text.hpp"

namespace anchord {

namespace {

/// The 74 bits of a version 7 that are not its time: 12 before the variant, 62 after it.
struct Tail {
  std::uint64_t high{}, low{};
};
constexpr std::uint64_t k_low_bits = (std::uint64_t{1} << 62) - 1;

std::uint64_t random_bits() {
  thread_local std::random_device random;
  return (std::uint64_t{random()} << 32) | random();
}

/// The first bit of a new one is left free, so that no millisecond counts over its end (RFC 9562, 6.2).
Tail new_tail() { return {random_bits() & 0x7ff, random_bits() & k_low_bits}; }

Tail later_tail(Tail before) {
  before.low += 1 + (random_bits() & 0xffff'ffff);
  return {before.high + (before.low >> 62), before.low & k_low_bits};
}

/// Of ids of one millisecond the later made is the greater: lists and "the newest" go by it.
Tail next_tail(std::uint64_t ms) {
  struct Last {
    std::uint64_t ms{};
    Tail tail;
  };
  static Locked<Last> last;
  const auto held = last.lock();
  held->tail = held->ms == ms ? later_tail(held->tail) : new_tail();
  held->ms = ms;
  return held->tail;
}

}  // namespace

Uuid make_uuid_v7(UtcTime now) {
  const auto ms = static_cast<std::uint64_t>(now.ns / 1'000'000);
  const Tail tail = next_tail(ms);
  Uuid id;
  for (std::size_t i = 0; i < 6; ++i) id.bytes[i] = static_cast<std::uint8_t>(ms >> (40 - 8 * i));
  id.bytes[6] = static_cast<std::uint8_t>(0x70 | (tail.high >> 8));
  id.bytes[7] = static_cast<std::uint8_t>(tail.high);
  for (std::size_t i = 8; i < 16; ++i)
    id.bytes[i] = static_cast<std::uint8_t>(tail.low >> (56 - 8 * (i - 8)));
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
  char digits[8];
  const auto end = std::to_chars(digits, digits + sizeof digits, id.value, 16).ptr;
  const auto n = static_cast<std::size_t>(end - digits);
  std::string text = "0x";
  if (n < 4) text.append(4 - n, '0');
  return text.append(digits, n);
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
