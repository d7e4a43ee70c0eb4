#include "drivers/drone/signing_key.hpp"

#include <sys/stat.h>

#include <algorithm>
#include <fstream>
#include <iterator>

namespace anchord::drone {
namespace {

constexpr std::string_view k_digits = "0123456789abcdef";

int digit(char c) {
  const char low = c >= 'A' && c <= 'F' ? static_cast<char>(c - 'A' + 'a') : c;
  const auto at = k_digits.find(low);
  return at == std::string_view::npos ? -1 : static_cast<int>(at);
}

}  // namespace

Result<mavlink::Secret> parse_signing_key(std::string_view text) {
  mavlink::Secret out{};
  if (text.size() == out.size()) {
    std::transform(text.begin(), text.end(), out.begin(),
                   [](char c) { return static_cast<std::uint8_t>(c); });
    return out;
  }
  while (!text.empty() && std::string_view(" \t\r\n").find(text.back()) != std::string_view::npos)
    text.remove_suffix(1);
  if (text.size() != 2 * out.size()) {
    return make_error(Errc::invalid_argument,
                      "a MAVLink signing key is 64 hexadecimal digits or 32 bytes; this "
                      "file has " +
                          std::to_string(text.size()) + " characters");
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    const int high = digit(text[2 * i]), low = digit(text[2 * i + 1]);
    if (high < 0 || low < 0)
      return make_error(Errc::invalid_argument, "character " + std::to_string(2 * i + (high < 0 ? 1 : 2)) +
                                                    " of the MAVLink signing key is not a hexadecimal digit");
    out[i] = static_cast<std::uint8_t>(high << 4 | low);
  }
  return out;
}

Result<mavlink::Secret> read_signing_key(const std::string& file) {
  struct stat found {};
  if (::stat(file.c_str(), &found) != 0) return make_error(Errc::not_found, file + ": there is no such file");
  if ((found.st_mode & (S_IRWXG | S_IRWXO)) != 0)
    return make_error(Errc::invalid_argument,
                      file + ": others may read this key; set its permissions to 0600 (chmod 600)");
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  auto key = parse_signing_key(text);
  if (!key) return make_error(key.error().code, file + ": " + key.error().message);
  return key;
}

}  // namespace anchord::drone
