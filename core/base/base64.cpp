#include "core/base/base64.hpp"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

namespace anchord {
namespace {

static_assert(std::endian::native == std::endian::little, "a group of digits is put together little endian");

/// Of each place in a group of four digits: the bits a digit stands for, where they belong in the three
/// bytes.
using DigitBits = std::array<std::array<std::uint32_t, 256>, 4>;
constexpr std::uint32_t k_no_digit = 0x0100'0000;

constexpr DigitBits digit_bits() {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  DigitBits bits{};
  for (auto& place : bits) place.fill(k_no_digit);
  for (std::uint32_t v = 0; v < alphabet.size(); ++v) {
    const auto digit = static_cast<unsigned char>(alphabet[v]);
    bits[0][digit] = v << 2;
    bits[1][digit] = (v >> 4) | ((v & 0x0f) << 12);
    bits[2][digit] = ((v >> 2) << 8) | ((v & 0x03) << 22);
    bits[3][digit] = v << 16;
  }
  return bits;
}
constexpr DigitBits k_digits = digit_bits();

// EVP_EncodeBlock counts in int; both are multiples of whole groups.
constexpr std::size_t k_raw = 3 << 20, k_coded = 4 << 20;

const unsigned char* bytes_of(std::string_view text) {
  return reinterpret_cast<const unsigned char*>(text.data());
}
unsigned char* bytes_at(std::string& text, std::size_t at) {
  return reinterpret_cast<unsigned char*>(text.data() + at);
}

}  // namespace

std::string base64(std::string_view bytes) {
  // OpenSSL ends each block with a 0, for which a std::string has room.
  std::string out((bytes.size() + 2) / 3 * 4, '\0');
  for (std::size_t from = 0, to = 0; from < bytes.size(); from += k_raw, to += k_coded) {
    const auto part = bytes.substr(from, k_raw);
    EVP_EncodeBlock(bytes_at(out, to), bytes_of(part), static_cast<int>(part.size()));
  }
  return out;
}

// Not OpenSSL's: its decoder takes '=' and white space where base64 has none, so that the text must be read
// twice, and goes byte by byte; impulse responses are 5 kB of base64 a range.
bool decode_base64(std::string_view text, std::span<std::byte> out) {
  if (text.size() % 4 != 0) return false;
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  if (out.size() != text.size() / 4 * 3 - padding) return false;
  if (text.empty()) return true;
  const auto digits_at = [&](std::size_t i) { return static_cast<unsigned char>(text[i]); };
  std::byte* to = out.data();
  std::uint32_t wrong = 0;
  const std::size_t last = text.size() - 4;
  for (std::size_t i = 0; i < last; i += 4, to += 3) {
    const std::uint32_t group = k_digits[0][digits_at(i)] | k_digits[1][digits_at(i + 1)] |
                                k_digits[2][digits_at(i + 2)] | k_digits[3][digits_at(i + 3)];
    wrong |= group;
    std::memcpy(to, &group, 3);
  }
  std::uint32_t group = k_digits[0][digits_at(last)] | k_digits[1][digits_at(last + 1)];
  if (padding < 2) group |= k_digits[2][digits_at(last + 2)];
  if (padding < 1) group |= k_digits[3][digits_at(last + 3)];
  std::memcpy(to, &group, 3 - padding);
  return ((wrong | group) & k_no_digit) == 0;
}

std::optional<std::string> from_base64(std::string_view text) {
  const std::size_t padding = text.ends_with("==") ? 2 : text.ends_with('=') ? 1 : 0;
  std::string out(text.size() / 4 * 3 - std::min(padding, text.size() / 4 * 3), '\0');
  if (!decode_base64(text, std::as_writable_bytes(std::span(out)))) return std::nullopt;
  return out;
}

}  // namespace anchord
