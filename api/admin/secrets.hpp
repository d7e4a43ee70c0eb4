#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace anchord::api {

inline constexpr std::size_t k_secret_digits = 64;

/// 256 random bits of OpenSSL's generator as 64 hex digits. Throws std::runtime_error when there is no
/// randomness.
std::string random_hex_256();
/// Takes the same time wherever the texts differ; false when the lengths differ.
bool equal_in_constant_time(std::string_view a, std::string_view b);

}  // namespace anchord::api
