#pragma once

#include <array>
#include <cstdio>
#include <string>

namespace anchord::procedure {

/// A sentence with one or two numbers in it, by a printf format of ours; at most 199 characters.
inline std::string sentence(const char* format, double a, double b = 0) {
  std::array<char, 200> out{};
  std::snprintf(out.data(), out.size(), format, a, b);
  return out.data();
}

}  // namespace anchord::procedure
