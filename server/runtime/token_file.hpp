#pragma once
#include <filesystem>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

/// The access token in a file: its first word, or `token` of the JSON that 'anchord token create' and POST
/// /tokens answer, so that their output can be kept as it comes. errors: invalid_argument, with the name of
/// the file
Result<std::string> token_in(const std::filesystem::path& file);

}  // namespace anchord::server
