// A disk that forgets what was not synced, for a program under test: loaded before libc (LD_PRELOAD), it
// keeps beside the data folder POWER_CUT_DATA a second one, POWER_CUT_DISK, which holds only what a power cut
// would leave:
//   content   of a file when fsync or fdatasync of it returned;
//   names     of a folder when fsync of the folder returned. A file that is new, renamed or removed is on the
//   disk by its old
//             name until then: POSIX promises no more, and file systems differ in what else they do.
// A kernel writes back earlier whenever it likes, so one write in four leaves some of its 512-byte sectors on
// the disk at once: torn writes and files longer than what is in them. POWER_CUT_SEED makes that repeatable
// for one order of calls.
//
// SQLite's files are followed by byte ranges and read through the program's own descriptor, since closing
// another one would end its locks; all others are copied whole. `-shm` holds nothing that outlives the
// machine.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <mutex>
#include <random>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace {

namespace fs = std::filesystem;

template <class F>
F next(const char* name) {
  return reinterpret_cast<F>(::dlsym(RTLD_NEXT, name));
}

struct Range {
  off_t from{}, to{};
};

/// What is written and not synced of one file.
struct Dirty {
  std::vector<Range> ranges;
  off_t shortest{-1};  ///< the least size since the last sync; -1 when nothing was cut off
};

class Disk {
 public:
  Disk() {
    const char* data = std::getenv("POWER_CUT_DATA");
    const char* disk = std::getenv("POWER_CUT_DISK");
    if (data == nullptr || disk == nullptr) return;
    const char* seed = std::getenv("POWER_CUT_SEED");
    if (seed != nullptr) random_.seed(static_cast<unsigned>(std::strtoul(seed, nullptr, 10)));
    data_ = data;
    names_ = fs::path(disk) / "names";
    files_ = fs::path(disk) / "files";
    std::error_code ignored;
    fs::create_directories(names_, ignored);
    fs::create_directories(files_, ignored);
    // What stood there before is on the disk: names/ was copied from it, and its files get the name by which
    // we know them.
    for (const auto& entry : fs::recursive_directory_iterator(names_, ignored)) {
      const fs::path real = data_ / fs::relative(entry.path(), names_, ignored);
      if (entry.is_regular_file(ignored)) fs::create_hard_link(entry.path(), files_ / key(real), ignored);
    }
    active_ = true;
  }

  /// The path of a descriptor within the data folder; empty for all else.
  fs::path path_of(int fd) const {
    if (!active_) return {};
    char path[4096];
    const ssize_t n = ::readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
    if (n <= 0) return {};
    const std::string_view found(path, static_cast<std::size_t>(n));
    const std::string& root = data_.native();
    const bool inside = found.starts_with(root) && (found.size() == root.size() || found[root.size()] == '/');
    return inside ? fs::path(found) : fs::path();
  }

  void wrote(int fd, const fs::path& path, off_t at, std::size_t size) {
    if (!by_ranges(path)) return;
    const std::scoped_lock lock(mutex_);
    const std::string file = key(path);
    dirty_[file].ranges.push_back({at, at + static_cast<off_t>(size)});
    if (random_() % 4 == 0) write_back_some(fd, file, at, size);
  }

  void cut_off(const fs::path& path, off_t size) {
    if (!by_ranges(path)) return;
    const std::scoped_lock lock(mutex_);
    Dirty& dirty = dirty_[key(path)];
    dirty.shortest = dirty.shortest < 0 ? size : std::min(dirty.shortest, size);
  }

  void synced(int fd, const fs::path& path) {
    struct stat info {};
    if (::fstat(fd, &info) != 0) return;
    const std::scoped_lock lock(mutex_);
    if (S_ISDIR(info.st_mode)) return sync_names(path);
    const std::string file = key(path);
    if (!by_ranges(path)) return copy_whole(path, file);
    const int to = open_on_disk(file);
    Dirty dirty = std::move(dirty_[file]);
    dirty_.erase(file);
    if (dirty.shortest >= 0) truncate(to, dirty.shortest);
    for (const Range& range : dirty.ranges) copy(fd, to, range);
    truncate(to, info.st_size);
    ::close(to);
  }

 private:
  static bool by_ranges(const fs::path& path) {
    const std::string name = path.filename().string();
    return name == "anchord.db" || name == "anchord.db-wal";
  }
  static bool forgotten(const fs::path& path) { return path.native().ends_with("-shm"); }

  /// One file through all its names: inode and time of birth, since inodes are used again.
  static std::string key(const fs::path& path) {
    struct statx info {};
    if (::statx(AT_FDCWD, path.c_str(), AT_SYMLINK_NOFOLLOW, STATX_INO | STATX_BTIME, &info) != 0)
      return "none";
    return std::to_string(info.stx_ino) + "-" + std::to_string(info.stx_btime.tv_sec) + "-" +
           std::to_string(info.stx_btime.tv_nsec);
  }

  int open_on_disk(const std::string& file) const {
    return ::open((files_ / file).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  }
  static void truncate(int fd, off_t size) {
    static const auto real = next<int (*)(int, off_t)>("ftruncate");
    real(fd, size);
  }
  static void write_at(int fd, const char* bytes, std::size_t size, off_t at) {
    static const auto real = next<ssize_t (*)(int, const void*, std::size_t, off_t)>("pwrite");
    real(fd, bytes, size, at);
  }
  static void copy(int from, int to, Range range) {
    char buffer[65536];
    while (range.from < range.to) {
      const auto want = std::min<off_t>(range.to - range.from, sizeof buffer);
      const ssize_t n = ::pread(from, buffer, static_cast<std::size_t>(want), range.from);
      if (n <= 0) return;  // cut off since it was written
      write_at(to, buffer, static_cast<std::size_t>(n), range.from);
      range.from += n;
    }
  }

  void copy_whole(const fs::path& path, const std::string& file) const {
    const int from = ::open(path.c_str(), O_RDONLY | O_CLOEXEC), to = open_on_disk(file);
    struct stat info {};
    if (from >= 0 && ::fstat(from, &info) == 0) {
      truncate(to, 0);
      copy(from, to, {0, info.st_size});
    }
    if (from >= 0) ::close(from);
    ::close(to);
  }

  void write_back_some(int fd, const std::string& file, off_t at, std::size_t size) {
    const int to = open_on_disk(file);
    constexpr off_t k_sector = 512;
    const off_t end = at + static_cast<off_t>(size);
    for (off_t sector = at; sector < end; sector += k_sector)
      if (random_() % 2 == 0) copy(fd, to, {sector, std::min(end, sector + k_sector)});
    ::close(to);
  }

  /// The folder's names on the disk become what they are now.
  void sync_names(const fs::path& folder) const {
    std::error_code ignored;
    const fs::path there = names_ / fs::relative(folder, data_, ignored);
    fs::create_directories(there, ignored);
    std::set<std::string> now;
    for (const auto& entry : fs::directory_iterator(folder, ignored)) {
      if (forgotten(entry.path())) continue;
      const std::string name = entry.path().filename().string();
      now.insert(name);
      if (entry.is_directory(ignored)) {
        fs::create_directories(there / name, ignored);
      } else if (entry.is_regular_file(ignored)) {
        const std::string file = key(entry.path());
        ::close(open_on_disk(file));
        if (fs::equivalent(there / name, files_ / file, ignored)) continue;
        // By a second name, so that at no instant neither is there.
        fs::create_hard_link(files_ / file, there / (name + ".new"), ignored);
        fs::rename(there / (name + ".new"), there / name, ignored);
      }
    }
    std::vector<fs::path> gone;
    for (const auto& entry : fs::directory_iterator(there, ignored))
      if (!now.contains(entry.path().filename().string())) gone.push_back(entry.path());
    for (const auto& path : gone) fs::remove_all(path, ignored);
  }

  bool active_{false};
  fs::path data_, names_, files_;
  std::mutex mutex_;
  std::map<std::string, Dirty> dirty_;
  std::mt19937 random_{1};
};

Disk& disk() {
  // Never destroyed: threads of the program may write until the very end.
  static Disk* const the_disk = new Disk;
  return *the_disk;
}
const bool k_at_start = (disk(), true);

template <class F>
void after(F&& note) {
  const int code = errno;
  note();
  errno = code;
}

ssize_t wrote_at(int fd, ssize_t n, off_t at) {
  if (n > 0) {
    after([&] {
      if (const auto path = disk().path_of(fd); !path.empty())
        disk().wrote(fd, path, at, static_cast<std::size_t>(n));
    });
  }
  return n;
}
// At the position of the descriptor, which has moved on.
ssize_t wrote_here(int fd, ssize_t n) { return n > 0 ? wrote_at(fd, n, ::lseek(fd, 0, SEEK_CUR) - n) : n; }

int synced(int fd, int result) {
  if (result == 0) {
    after([&] {
      if (const auto path = disk().path_of(fd); !path.empty()) disk().synced(fd, path);
    });
  }
  return result;
}
int cut_off(int fd, int result, off_t size) {
  if (result == 0) {
    after([&] {
      if (const auto path = disk().path_of(fd); !path.empty()) disk().cut_off(path, size);
    });
  }
  return result;
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* bytes, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  return wrote_here(fd, real(fd, bytes, size));
}
ssize_t writev(int fd, const iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const iovec*, int)>("writev");
  return wrote_here(fd, real(fd, parts, count));
}
ssize_t pwrite(int fd, const void* bytes, size_t size, off_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off_t)>("pwrite");
  return wrote_at(fd, real(fd, bytes, size, at), at);
}
ssize_t pwrite64(int fd, const void* bytes, size_t size, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  return wrote_at(fd, real(fd, bytes, size, at), at);
}
int ftruncate(int fd, off_t size) noexcept {
  static const auto real = next<int (*)(int, off_t)>("ftruncate");
  return cut_off(fd, real(fd, size), size);
}
int ftruncate64(int fd, off64_t size) noexcept {
  static const auto real = next<int (*)(int, off64_t)>("ftruncate64");
  return cut_off(fd, real(fd, size), size);
}
int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return synced(fd, real(fd));
}
int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return synced(fd, real(fd));
}
}
