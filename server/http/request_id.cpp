#include "server/http/request_id.hpp"

#include <algorithm>
#include <array>
#include <cstdio>
#include <random>

namespace anchord::server {

std::string request_id_of(std::string_view given) {
  const bool plain = !given.empty() && given.size() <= 64 && std::ranges::all_of(given, [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '.' ||
           c == '_' || c == '-';
  });
  if (plain) return std::string(given);
  thread_local std::mt19937_64 random{std::random_device{}()};  // names requests, protects nothing
  std::array<char, 20> text{};
  std::snprintf(text.data(), text.size(), "%016llx", static_cast<unsigned long long>(random()));
  return {text.data(), 16};
}

}  // namespace anchord::server
