#include "core/base/base64.hpp"

#include <openssl/evp.h>
#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>

#include "core/base/bytes.hpp"

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

unsigned char* bytes_at(std::string& text, std::size_t at) {
  return reinterpret_cast<unsigned char*>(text.data() + at);
}

#if defined(__x86_64__)
const bool k_avx2 = __builtin_cpu_supports("avx2") != 0;

template <class... Bytes>
__attribute__((target("avx2"))) __m256i both_halves(Bytes... bytes) {
  return _mm256_broadcastsi128_si256(_mm_setr_epi8(static_cast<char>(bytes)...));
}

/// Digits from the begin of the text, 32 at a time, as long as 32 bytes have room in `out`; how many were
/// taken. A group with anything else than digits is left to who goes on. By the lower and upper half of each
/// byte: one table says to which rows of ASCII its lower half does not belong, another which row it is in, a
/// third what is added to it there (Mula and Lemire 2018, "Faster Base64 encoding and decoding using AVX2
/// instructions").
__attribute__((target("avx2"))) std::size_t take_digits(std::string_view text, std::span<std::byte> out) {
  // Rows 2 (+ and /), 3 (0 to 9), 4 and 6 (letters from A, a), 5 and 7 (letters to Z, z); 0x10: no digit is
  // there.
  const __m256i row = both_halves(0x10, 0x10, 0x01, 0x02, 0x04, 0x08, 0x04, 0x08, 0x10, 0x10, 0x10, 0x10,
                                  0x10, 0x10, 0x10, 0x10);
  const __m256i not_in = both_halves(0x15, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x11, 0x13, 0x1a,
                                     0x1b, 0x1b, 0x1b, 0x1a);
  const __m256i to_value =
      both_halves(0, 63 - '/', 62 - '+', 52 - '0', -'A', -'A', 26 - 'a', 26 - 'a', 0, 0, 0, 0, 0, 0, 0, 0);
  const __m256i low_half = _mm256_set1_epi8(0x0f), slash = _mm256_set1_epi8('/');
  const __m256i three_of_four = both_halves(2, 1, 0, 6, 5, 4, 10, 9, 8, 14, 13, 12, -1, -1, -1, -1);
  std::size_t taken = 0;
  for (std::size_t to = 0; taken + 32 <= text.size() && to + 32 <= out.size(); taken += 32, to += 24) {
    const __m256i digits = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(text.data() + taken));
    const __m256i low = _mm256_and_si256(digits, low_half);
    const __m256i high = _mm256_and_si256(_mm256_srli_epi16(digits, 4), low_half);
    if (!_mm256_testz_si256(_mm256_shuffle_epi8(row, high), _mm256_shuffle_epi8(not_in, low))) break;
    // '/' is in the row of '+' and has a place of its own, one before.
    const __m256i place = _mm256_add_epi8(high, _mm256_cmpeq_epi8(digits, slash));
    const __m256i values = _mm256_add_epi8(digits, _mm256_shuffle_epi8(to_value, place));
    // Pairs of 6 bits to 12, pairs of 12 to 24.
    const __m256i twelve = _mm256_maddubs_epi16(values, _mm256_set1_epi32(0x01400140));
    const __m256i bits = _mm256_madd_epi16(twelve, _mm256_set1_epi32(0x00011000));
    const __m256i packed = _mm256_permutevar8x32_epi32(_mm256_shuffle_epi8(bits, three_of_four),
                                                       _mm256_setr_epi32(0, 1, 2, 4, 5, 6, 7, 7));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(out.data() + to), packed);
  }
  return taken;
}
#endif

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
#if defined(__x86_64__)
  if (k_avx2) {
    const std::size_t taken = take_digits(text.substr(0, text.size() - 4), out);
    text.remove_prefix(taken);
    out = out.subspan(taken / 4 * 3);
  }
#endif
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
