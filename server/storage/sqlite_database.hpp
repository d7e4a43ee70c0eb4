#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "core/ports/stores.hpp"

namespace anchord {

class CirArchive;
class WorkStore;

/// What a commit waits for; docs/durability.md says what survives which accident.
enum class Synchronous : std::uint8_t { normal, full, extra };
inline constexpr auto k_synchronous_words = enum_table<Synchronous>(
    {{"normal", Synchronous::normal}, {"full", Synchronous::full}, {"extra", Synchronous::extra}});

struct StorageOptions {
  std::filesystem::path data_dir;              ///< made with mode 0700 when absent
  Synchronous synchronous{Synchronous::full};  ///< the one that keeps acknowledged rows over a power cut
  std::size_t readers{3};                      ///< read-only connections
  std::size_t max_queued_rows{200'000};        ///< beyond it an append answers queue_full
  std::size_t max_queued_calls{1'000};
  std::uint64_t checkpoint_wal_bytes{16u << 20};  ///< the writer moves the WAL into the database beyond this
  std::uint64_t warn_free_bytes{std::uint64_t{2} << 30};
  std::uint64_t refuse_free_bytes{500u << 20};  ///< below: no new missions
  std::uint64_t reserve_bytes{64u << 20};       ///< file given up to let a running flight finish; 0: none
  std::optional<std::uint32_t> max_pages{};     ///< limit of the file in pages of 8 KiB (quota)
  bool full_check{false};                       ///< integrity_check instead of quick_check at start
};

enum class StorageLevel : std::uint8_t {
  ok,
  disk_low,     ///< below warn_free_bytes
  disk_scarce,  ///< below refuse_free_bytes, or living on the reserve: no new missions
  stalled,      ///< a write has been under way for seconds: a stuck disk, or somebody else's lock
  full,         ///< the last write found no space
  unavailable,  ///< the last write failed; reopening is tried
};
inline constexpr auto k_storage_level_words =
    enum_table<StorageLevel>({{"ok", StorageLevel::ok},
                              {"disk_low", StorageLevel::disk_low},
                              {"disk_scarce", StorageLevel::disk_scarce},
                              {"stalled", StorageLevel::stalled},
                              {"full", StorageLevel::full},
                              {"unavailable", StorageLevel::unavailable}});
inline std::string to_string(StorageLevel level) { return std::string(k_storage_level_words.word(level)); }
inline std::string to_string(Synchronous word) { return std::string(k_synchronous_words.word(word)); }

struct StorageHealth {
  StorageLevel level{StorageLevel::ok};
  std::string reason;  ///< in words; empty when ok
  bool writable() const { return level < StorageLevel::full; }
  std::size_t queued_calls{}, queued_rows{};
  std::uint64_t db_bytes{}, wal_bytes{}, disk_free_bytes{};
  std::uint64_t commits{}, rows_written{};
  double last_commit_s{};
  int schema_version{};
  std::optional<bool> stood_by{};  ///< another server waits to take over; nothing where none ever can
  Synchronous synchronous{Synchronous::full};
};

/// The files with impulse responses that a copy of a database needs to be whole.
struct CirCopies {
  std::size_t files{};  ///< that are there
  std::uint64_t bytes{};
  std::vector<std::string> missing;  ///< which are not, with the reason of each
};

struct BackupReport {
  std::filesystem::path file;
  std::uint64_t bytes{};
  std::string sha256_hex;  ///< also written beside it as <file>.sha256
  CirCopies cirs;          ///< in the folder cir-archive beside it, listed in <file>.sha256 too
};

/// An open data folder. Everything may be called from any thread; the destructor finishes queued writes,
/// checkpoints and closes.
class Database {
 public:
  virtual ~Database() = default;
  virtual const Stores& stores() = 0;
  /// In the folder cir-archive of the data folder.
  virtual CirArchive& cir_archive() = 0;
  virtual StorageHealth health() = 0;
  /// Online copy while writes go on: fsynced, integrity-checked, with its SHA-256, and beside it the files of
  /// the archive that it needs. The file must not exist. False from `go_on`: canceled.
  using GoOn = std::function<bool()>;
  virtual Result<BackupReport> backup(const std::filesystem::path& file, const GoOn& go_on) = 0;
  Result<BackupReport> backup(const std::filesystem::path& file) {
    return backup(file, [] { return true; });
  }
  /// Work that other processes may do; null: this database is of one process.
  virtual WorkStore* work() { return nullptr; }
};

/// Opens (first time: makes) DIR/anchord.db, migrates it, checks it. Messages are for the operator's
/// terminal. Errors: conflict (another process has the folder), unsupported (made by a newer anchord, or not
/// by anchord; the file is untouched), storage_unavailable (damaged, or missing where one was: with the
/// commands that recover), storage_full.
Result<std::unique_ptr<Database>> open_database(const StorageOptions& options);

/// Whether a backup is whole: its SHA-256 where it was written down, integrity_check, ours and not newer.
/// Reads all of it. Errors: not_found, unsupported.
Result<void> check_backup(const std::filesystem::path& backup);

/// Whether the files of the archive that a backup needs are beside it, each with its SHA-256. Reads all of
/// them. Errors: unsupported, where the backup cannot be read.
Result<CirCopies> check_backup_cirs(const std::filesystem::path& backup);

/// The same by <backup>.sha256, in no time.
CirCopies listed_backup_cirs(const std::filesystem::path& backup);

struct Restored {
  std::optional<std::filesystem::path> old;  ///< where the old database is now; nothing when there was none
  CirCopies cirs;
};
/// Puts a backup in the place of a folder's database, which nobody may have open. The backup is checked
/// first (its .sha256 where there is one, integrity_check), and what stood there is kept beside it. The files
/// of the archive that it needs are brought into the folder, unless they are there.
/// without_cirs  also where some of them are missing
/// Errors: conflict (a server has the folder), not_found, unsupported (no anchord database, damaged, or
/// without the files that it needs), storage_unavailable, storage_full; the folder is as before then.
Result<Restored> restore_backup(const std::filesystem::path& data_dir, const std::filesystem::path& backup,
                                bool without_cirs = false);

/// Short word of the backend's version for /version: the newest migration this program knows.
int newest_schema_version();

}  // namespace anchord
