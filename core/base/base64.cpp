#include "core/base/base64.hpp"

#include <openssl/evp.h>

#include <algorithm>

namespace anchord {
namespace {

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

std::optional<std::string> from_base64(std::string_view text) {
  if (text.size() % 4 != 0) return std::nullopt;
  // OpenSSL overlooks white space round a block and takes '=' anywhere for a zero: neither is base64 here.
  const std::size_t end = std::min(text.find('='), text.size()), padding = text.size() - end;
  if (padding > 2 || text.substr(end) != std::string_view("==").substr(0, padding)) return std::nullopt;
  const auto is_digit = [](char c) {
    return (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
  };
  if (!std::all_of(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(end), is_digit))
    return std::nullopt;
  std::string out(text.size() / 4 * 3, '\0');
  for (std::size_t from = 0, to = 0; from < text.size(); from += k_coded, to += k_raw) {
    const auto part = text.substr(from, k_coded);
    if (EVP_DecodeBlock(bytes_at(out, to), bytes_of(part), static_cast<int>(part.size())) < 0)
      return std::nullopt;
  }
  out.resize(out.size() - padding);
  return out;
}

}  // namespace anchord
