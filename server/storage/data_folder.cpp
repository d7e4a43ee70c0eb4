#include "server/storage/data_folder.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string_view>
#include <system_error>

namespace anchord::sql {
namespace {

constexpr const char* k_data_folder_lock = "anchord.lock";
constexpr const char* k_marker = "anchord.folder";
constexpr const char* k_reserve = "reserve.bin";
constexpr const char* k_postgres = "anchord.postgresql";
constexpr mode_t k_private_file = 0600;
constexpr mode_t k_private_folder = 0700;

Error system_error(const std::string& what, int code) {
  const bool full = code == ENOSPC || code == EDQUOT;
  return make_error(full ? Errc::storage_full : Errc::storage_unavailable, what + ": " + std::strerror(code));
}

int open_file(const std::filesystem::path& path, int flags) {
  return ::open(path.c_str(), flags | O_CLOEXEC, k_private_file);
}

std::string pid_in(int fd) {
  std::array<char, 32> text{};
  const ssize_t n = ::pread(fd, text.data(), text.size(), 0);
  return n > 0 ? " (process " + std::string(text.data(), static_cast<std::size_t>(n)) + ")" : "";
}

Result<void> write_small(const std::filesystem::path& path, std::string_view text) {
  const int fd = open_file(path, O_WRONLY | O_CREAT | O_TRUNC);
  if (fd < 0) return system_error(path.string(), errno);
  const bool ok =
      ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) && ::fsync(fd) == 0;
  const int code = errno;
  ::close(fd);
  if (!ok) return system_error(path.string(), code);
  return sync_path(path.parent_path());
}

/// The names of new folders must outlive a power cut, or all that is acknowledged in them goes with them. As
/// far up as we may look: what was there before needs no help.
void sync_names_above(const std::filesystem::path& dir) {
  auto folder = std::filesystem::absolute(dir).lexically_normal();
  if (!folder.has_filename()) folder = folder.parent_path();
  while (folder.has_relative_path()) {
    folder = folder.parent_path();
    if (!sync_path(folder)) return;
  }
}

std::string shell_quoted(const std::filesystem::path& path) { return "'" + path.string() + "'"; }

}  // namespace

std::string postgres_of_folder(const std::filesystem::path& dir) {
  std::string shown;
  std::ifstream file(dir / k_postgres);
  std::getline(file, shown);
  return shown;
}

Result<std::unique_ptr<DataFolder>> DataFolder::open(const std::filesystem::path& dir,
                                                     std::uint64_t reserve_bytes) {
  ::umask(S_IRWXG | S_IRWXO);
  std::error_code error;
  const bool fresh = std::filesystem::create_directories(dir, error);
  if (error) return system_error("data folder " + dir.string(), error.value());
  if (fresh) {
    ::chmod(dir.c_str(), k_private_folder);
    sync_names_above(dir);
  }
  const auto path = dir / k_data_folder_lock;
  const int fd = open_file(path, O_RDWR | O_CREAT);
  if (fd < 0) return system_error("data folder " + dir.string() + ": " + k_data_folder_lock, errno);
  const int folder_fd = open_file(dir, O_RDONLY | O_DIRECTORY);
  // Where folders take no lock (some network file systems), that of the file is all there is.
  const bool in_use = ::flock(fd, LOCK_EX | LOCK_NB) != 0 ||
                      (folder_fd >= 0 && ::flock(folder_fd, LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK);
  if (in_use) {
    const std::string holder = pid_in(fd);
    ::close(fd);
    if (folder_fd >= 0) ::close(folder_fd);
    return make_error(Errc::conflict,
                      "data folder " + dir.string() + " is in use by another anchord" + holder);
  }
  const std::string pid = std::to_string(::getpid());
  if (::ftruncate(fd, 0) != 0 || ::pwrite(fd, pid.data(), pid.size(), 0) < 0) {
    // Only the message for a second process gets poorer: the lock itself is held.
    errno = 0;
  }
  return std::unique_ptr<DataFolder>(new DataFolder(dir, fd, folder_fd, reserve_bytes));
}

DataFolder::DataFolder(std::filesystem::path dir, int lock_fd, int folder_fd, std::uint64_t reserve_bytes)
    : dir_(std::move(dir)), lock_fd_(lock_fd), folder_fd_(folder_fd), reserve_bytes_(reserve_bytes) {}

DataFolder::~DataFolder() {
  ::close(lock_fd_);
  if (folder_fd_ >= 0) ::close(folder_fd_);
}

bool DataFolder::had_database() const {
  std::error_code ignored;
  return std::filesystem::exists(dir_ / k_marker, ignored);
}

Result<void> DataFolder::note_database() {
  if (had_database()) return boost::outcome_v2::success();
  return write_small(dir_ / k_marker,
                     "anchord data folder: a database was made here; do not delete this file\n");
}

Result<void> DataFolder::note_postgres(const std::string& shown_address) {
  if (postgres() == shown_address) return boost::outcome_v2::success();
  return write_small(dir_ / k_postgres, shown_address + "\n");
}

void DataFolder::forget_database() {
  for (const char* name : {k_postgres, k_marker}) ::unlink((dir_ / name).c_str());
}

Result<void> DataFolder::check_rows_are_here() const {
  const std::string there = postgres();
  if (there.empty()) return boost::outcome_v2::success();
  return make_error(Errc::unsupported, "the database of data folder " + dir_.string() + " are in " + there +
                                           ": give it with --database, or give another folder");
}

std::uint64_t DataFolder::free_bytes() const {
  struct statvfs info {};
  if (::statvfs(dir_.c_str(), &info) != 0) return 0;
  return static_cast<std::uint64_t>(info.f_bavail) * info.f_frsize;
}

bool DataFolder::has_reserve() const {
  // A power cut may leave its name without its space.
  std::error_code error;
  const auto bytes = std::filesystem::file_size(dir_ / k_reserve, error);
  return reserve_bytes_ == 0 || (!error && bytes >= reserve_bytes_);
}

void DataFolder::fill_reserve(std::uint64_t keep_free_bytes) {
  if (has_reserve() || free_bytes() < keep_free_bytes + reserve_bytes_) return;
  const auto path = dir_ / k_reserve;
  const int fd = open_file(path, O_WRONLY | O_CREAT);
  if (fd < 0) return;
  const bool ok = ::posix_fallocate(fd, 0, static_cast<off_t>(reserve_bytes_)) == 0;
  ::close(fd);
  if (!ok) ::unlink(path.c_str());
}

bool DataFolder::give_up_reserve() { return ::unlink((dir_ / k_reserve).c_str()) == 0; }

std::string DataFolder::recovery_commands() const {
  // Made by a server whose database was taken away from under it, so the newest there is.
  std::string saved_copies;
  std::error_code error;
  for (std::filesystem::directory_iterator it(dir_, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    if (!name.starts_with(database().filename().string() + ".saved-") || name.ends_with(".sha256")) continue;
    saved_copies +=
        "\n  anchord backup restore " + shell_quoted(it->path()) + " --data-dir " + shell_quoted(dir_);
  }
  if (!saved_copies.empty())
    return "What was stored when the file was removed under a running server is in a copy beside it. To "
           "restore it:" +
           saved_copies;
  const std::string db = shell_quoted(database());
  const std::string recovered = shell_quoted(dir_ / "recovered.db");
  const std::string saved = shell_quoted(dir_.string() + ".damaged");
  return "Nothing was changed. Stop every anchord, then make a copy of all files, and restore the newest "
         "backup (of --backup-dir, "
         "where that is set; the highest number is the newest):\n"
         "  cp -a " +
         shell_quoted(dir_) + " " + saved +
         "\n"
         "  anchord backup restore \"$(ls " +
         shell_quoted(backups()) + "/anchord-*.db | tail -1)\" --data-dir " + shell_quoted(dir_) +
         "\n"
         "Or save what can be read, and look how many ranges that is before it takes the place of the "
         "database:\n"
         // Not .recover: that of Debian 12's sqlite3 answers "SQL logic error" to every database.
         "  (echo 'PRAGMA application_id=1095648072;'; echo \"PRAGMA user_version=$(sqlite3 " +
         db + " 'PRAGMA user_version');\"; sqlite3 " + db +
         " .dump | sed 's/^ROLLBACK.*/COMMIT;/') | sqlite3 " + recovered + "; sqlite3 " + recovered +
         " 'SELECT count(*) FROM uwb_range'\n"
         "  mv " +
         recovered + " " + db + " && rm -f " + shell_quoted(wal()) + " " +
         shell_quoted(dir_ / "anchord.db-shm");
}

Result<void> sync_path(const std::filesystem::path& path) {
  const int fd = ::open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return system_error(path.string(), errno);
  const bool ok = ::fsync(fd) == 0;
  const int code = errno;
  ::close(fd);
  if (!ok) return system_error(path.string(), code);
  return boost::outcome_v2::success();
}

}  // namespace anchord::sql
