#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/cir_file.hpp"
#include "server/storage/sql.hpp"
#include "server/storage/sqlite_database.hpp"

/// Files of the archive that leave with a copy of their database, and come back with it. A folder of copies
/// is like cir-archive itself, and serves all backups beside it; each file has its SHA-256 in FILE.sha256.
namespace anchord::sql {

/// Without it some responses of the database cannot be read.
struct NeededCirFile {
  MissionId mission{};
  std::string file;  ///< its name where it was written
  std::string sha256_hex;
  std::uint64_t bytes{};
};

/// By the rows of a database of the newest version. Throws SqlError.
std::vector<NeededCirFile> needed_cir_files(Connection& connection);
/// Of a backup, of any version. errors: unsupported
Result<std::vector<NeededCirFile>> needed_by_backup(const std::filesystem::path& backup);

/// Where the files of a database's backups are: the folder cir-archive beside them.
CirFolder copies_beside(const std::filesystem::path& backup);

/// The file of a folder with these bytes, all of which are read; nothing where there is none.
std::optional<std::filesystem::path> read_cir_file(const CirFolder& folder, const NeededCirFile& needed);
/// The same by its size, and by its SHA-256 where that is written beside it: known to have been whole.
std::optional<std::filesystem::path> listed_cir_file(const CirFolder& folder, const NeededCirFile& needed);

enum class Found : std::uint8_t {
  listed,  ///< what is there already and is listed_cir_file() is not read again
  read,
};
struct BroughtCirFiles {
  CirCopies report;
  std::vector<std::filesystem::path> files;  ///< of each that is needed; empty: missing
  std::vector<std::filesystem::path> made;   ///< of these, by this call
};
/// Copies what `to` does not have yet. Each copy is synced, read back and compared by its SHA-256 before it
/// has its name. What cannot be had is in the report. errors: canceled; the files copied until then stay.
Result<BroughtCirFiles> bring_cir_files(const std::vector<NeededCirFile>& needed, const CirFolder& from,
                                        const CirFolder& to, Found found, const std::function<bool()>& go_on);

/// As `sha256sum -c` reads it, into <file>.sha256: the database first, then the files that it needs.
Result<void> write_backup_list(const BackupReport& report, const std::filesystem::path& file,
                               const std::vector<NeededCirFile>& needed, const BroughtCirFiles& brought);

/// Removes copies beside backups that none of these needs. Where one cannot be read, nothing.
void drop_unneeded_copies(const std::filesystem::path& backups);

}  // namespace anchord::sql
