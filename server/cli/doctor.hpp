#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"

namespace anchord::cli {

/// A worker of a database that was not seen for so long is not in order.
inline constexpr double k_worker_silent_s = 60;

/// One thing looked at, what was seen, and what to do about it.
struct Finding {
  enum class Level : std::uint8_t { ok, warning, failed };
  Level level{Level::ok};
  std::string what, seen, advice{};
};
inline constexpr auto k_finding_words = enum_table<Finding::Level>(
    {{"ok", Finding::Level::ok}, {"warning", Finding::Level::warning}, {"failed", Finding::Level::failed}});

struct DoctorOptions {
  std::filesystem::path data_dir{"anchord-data"};
  std::string database{};                             ///< address of a PostgreSQL; empty: SQLite in data_dir
  std::vector<std::string> listen{"127.0.0.1:8420"};  ///< where a server would listen
  std::string tls_certificate{}, tls_key{};           ///< files; empty: no TLS
};

/// Everything outside the program that a server needs: folder, disk, database, port, clock, serial devices;
/// and the server of this folder when it runs. Changes nothing, makes nothing.
std::vector<Finding> examine(const DoctorOptions& options);

/// An array of {level, what, seen, advice}.
std::string findings_json(const std::vector<Finding>& findings);

}  // namespace anchord::cli
