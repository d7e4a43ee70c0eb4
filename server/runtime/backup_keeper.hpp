#pragma once

#include <filesystem>
#include <mutex>

#include "core/ports/backups.hpp"

namespace anchord {
class Database;
}

namespace anchord::server {

/// Backups of one database in one folder, named anchord-<UTC time>.db; other files there are left alone.
class BackupKeeper final : public Backups {
 public:
  struct Options {
    std::filesystem::path dir;
    std::size_t keep{7};  ///< older ones go, but never the only one
    std::size_t every_h{24};
    bool scheduled{true};  ///< false: only when asked for
  };
  BackupKeeper(Database& database, const Clock& clock, Options options);
  Result<Backup> make() override;
  std::vector<Backup> list() const override;
  bool due(std::uint64_t flights_ended) override;

 private:
  Database& database_;
  const Clock& clock_;
  const Options options_;
  std::mutex making_;
  std::mutex due_mutex_;
  UtcTime looked_first_{}, not_before_{};
  std::uint64_t flights_saved_{0};
};

}  // namespace anchord::server
