#include "server/http/base64.hpp"

#include <cstdint>

namespace anchord::server {

std::optional<std::string> base64_decoded(std::string_view text) {
  static constexpr std::string_view k_alphabet =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  if (text.size() % 4 != 0) return std::nullopt;
  std::string out;
  for (std::size_t i = 0; i < text.size(); i += 4) {
    std::uint32_t bits = 0;
    int pads = 0;
    for (std::size_t k = 0; k < 4; ++k) {
      const char c = text[i + k];
      const auto value = k_alphabet.find(c);
      if (c == '=' && i + 4 == text.size() && k >= 2) {
        ++pads;
        bits <<= 6;
      } else if (value != std::string_view::npos && pads == 0) {
        bits = bits << 6 | static_cast<std::uint32_t>(value);
      } else {
        return std::nullopt;
      }
    }
    out.push_back(static_cast<char>(bits >> 16));
    if (pads < 2) out.push_back(static_cast<char>(bits >> 8 & 0xff));
    if (pads < 1) out.push_back(static_cast<char>(bits & 0xff));
  }
  return out;
}

}  // namespace anchord::server
