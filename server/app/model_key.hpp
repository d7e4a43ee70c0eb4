#pragma once

#include <filesystem>
#include <string>

#include "core/base/result.hpp"

namespace anchord::server {

inline constexpr const char* k_model_key_file = "models.key";

struct ModelKey {
  std::string text;   ///< 64 hex digits
  bool fresh{false};  ///< made just now
};

/// DATA_DIR/models.key, mode 0600; made at the first start. errors: storage_unavailable (cannot be read or
/// written), invalid_argument (not what it should be, or open to others)
Result<ModelKey> read_or_make_model_key(const std::filesystem::path& data_dir);

}  // namespace anchord::server
