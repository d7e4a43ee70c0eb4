#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace anchord::cli {

/// Address of the server that has this data folder open, as it left it there; null when none runs (or none
/// that we may read).
std::optional<std::string> running_server(const std::filesystem::path& data_dir);
/// The first admin token of the folder; empty when there is none.
std::string folder_token(const std::filesystem::path& data_dir);
/// The token of ANCHORD_TOKEN, else that of the folder; empty when there is neither.
std::string own_token(const std::filesystem::path& data_dir);

}  // namespace anchord::cli
