#pragma once

#include <filesystem>
#include <map>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

/// A TOML file as flat text: {"http.max_connections": "100"}; arrays of strings are joined by commas.
/// Errors: not_found, invalid_argument (with line and column).
Result<std::map<std::string, std::string>> read_toml(const std::filesystem::path& file);

}  // namespace anchord::server
