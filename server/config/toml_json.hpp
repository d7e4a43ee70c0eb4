#pragma once

#include <filesystem>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

/// A file of one object, as JSON: TOML where its name ends in .toml, else JSON as it is. Errors: not_found;
/// invalid_argument (with line and column; more than 64 KiB).
Result<std::string> read_as_json(const std::filesystem::path& file);

}  // namespace anchord::server
