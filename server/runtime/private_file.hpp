#pragma once

#include <filesystem>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

/// Writes a file only its owner may read, whole or not at all. errors: storage_full, storage_unavailable
Result<void> write_private(const std::filesystem::path& file, const std::string& text);

}  // namespace anchord::server
