#include "server/http/request_id.hpp"

#include <algorithm>
#include <cstdint>
#include <random>

namespace anchord::server {

std::string request_id_of(std::string_view given) {
  const bool plain = !given.empty() && given.size() <= 64 && std::ranges::all_of(given, [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == '_' || c == '-';
  });
  if (plain) return std::string(given);
  thread_local std::mt19937_64 random{std::random_device{}()};  // names requests, protects nothing
  static constexpr std::string_view k_hex = "0123456789abcdef";
  std::string text(16, '0');
  std::uint64_t number = random();
  for (auto digit = text.rbegin(); digit != text.rend(); ++digit, number >>= 4) *digit = k_hex[number & 0xf];
  return text;
}

}  // namespace anchord::server
