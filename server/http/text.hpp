#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace anchord::server {

/// ASCII only, whatever the locale.
std::string lower(std::string_view text);
bool iequals(std::string_view a, std::string_view b);
/// Without spaces and tabs at both ends.
std::string_view trim(std::string_view text);
/// At every separator; "a,,b" gives three.
std::vector<std::string_view> split(std::string_view text, char separator);

}  // namespace anchord::server
