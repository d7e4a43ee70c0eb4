#pragma once

#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::api {

/// Magnitudes by their row's key, until the ranging says where its first path is.
struct CirTable {
  std::vector<std::string> join_names{};  ///< columns of both tables, in the order of the key
  std::unordered_map<std::string, std::vector<float>> taps{};
};

/// CSV of taps m0, m1, ... with join columns (setup, idx, seq); rows with a tap that is no number are passed
/// over. errors: not_found, bad_frame (file and line named), invalid_argument (no join column, too few taps)
Result<CirTable> read_cir(const std::filesystem::path& path);

/// Key of a row: its cells of these columns.
std::string joined(const std::vector<std::string_view>& cells, std::span<const std::size_t> columns);

}  // namespace anchord::api
