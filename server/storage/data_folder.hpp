#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "core/base/result.hpp"

namespace anchord::sql {

/// The PostgreSQL that has the rows of a data folder, as it is shown to people; empty: they are in the
/// folder.
std::string postgres_of_folder(const std::filesystem::path& dir);

/// The folder with the database: its lock, its reserve of disk space, and what stands in it.
class DataFolder {
 public:
  /// Makes the folder (0700) when absent and takes its lock, which is on a file in it, that names the
  /// process, and on the folder itself, which nobody deletes because it looks left over; from here on the
  /// umask is 077. Errors: conflict when another process has it; storage_unavailable.
  static Result<std::unique_ptr<DataFolder>> open(const std::filesystem::path& dir,
                                                  std::uint64_t reserve_bytes);
  ~DataFolder();
  DataFolder(const DataFolder&) = delete;
  DataFolder& operator=(const DataFolder&) = delete;

  const std::filesystem::path& dir() const { return dir_; }
  std::filesystem::path database() const { return dir_ / "anchord.db"; }
  std::filesystem::path wal() const { return dir_ / "anchord.db-wal"; }
  std::filesystem::path backups() const { return dir_ / "backups"; }
  std::filesystem::path cir_archive() const { return dir_ / "cir-archive"; }

  /// A database was made here once; from then on an empty or missing one is damage, never a fresh start.
  bool had_database() const;
  Result<void> note_database();

  std::string postgres() const { return postgres_of_folder(dir_); }
  Result<void> note_postgres(const std::string& shown_address);
  /// As of a folder that never had rows: the next database is made here.
  void forget_database();
  /// Errors: unsupported where they are in PostgreSQL, with what to do.
  Result<void> check_rows_are_here() const;

  std::uint64_t free_bytes() const;
  /// Makes the reserve file when there is space for it beyond `keep_free_bytes`.
  void fill_reserve(std::uint64_t keep_free_bytes);
  bool has_reserve() const;
  /// Deletes the reserve; false when there was none.
  bool give_up_reserve();

  /// What the operator can type, for this folder.
  std::string recovery_commands() const;

 private:
  DataFolder(std::filesystem::path dir, int lock_fd, int folder_fd, std::uint64_t reserve_bytes);
  const std::filesystem::path dir_;
  const int lock_fd_, folder_fd_;
  const std::uint64_t reserve_bytes_;
};

/// fsync of a file or of a folder (for the names in it).
Result<void> sync_path(const std::filesystem::path& path);

}  // namespace anchord::sql
