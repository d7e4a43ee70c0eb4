#pragma once

#include <sqlite3.h>

#include <atomic>
#include <cstring>
#include <map>
#include <mutex>
#include <thread>

namespace anchord {

/// A disk whose fsync does not return while `stuck`: what SQLite opens meanwhile it opens through this one,
/// which passes everything else on to the system's files. One at a time.
class StuckDisk {
 public:
  StuckDisk() : system_(sqlite3_vfs_find(nullptr)), disk_(*system_) {
    stuck = false;
    disk_.zName = "stuck-disk";
    disk_.pNext = nullptr;
    disk_.pAppData = system_->pAppData;
    disk_.xOpen = [](sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* flags_out) {
      auto* system = sqlite3_vfs_find("unix");
      const int result = system->xOpen(system, name, file, flags, flags_out);
      if (result == SQLITE_OK && file->pMethods != nullptr) file->pMethods = &waiting(*file->pMethods);
      return result;
    };
    sqlite3_vfs_register(&disk_, 1);
  }
  ~StuckDisk() {
    stuck = false;
    sqlite3_vfs_register(system_, 1);
    sqlite3_vfs_unregister(&disk_);
  }
  StuckDisk(const StuckDisk&) = delete;
  StuckDisk& operator=(const StuckDisk&) = delete;

  static inline std::atomic<bool> stuck{false};

 private:
  /// The methods of the system's files but for sync; they find theirs by the file's first field.
  static const sqlite3_io_methods& waiting(const sqlite3_io_methods& of) {
    static std::mutex mutex;
    static std::map<const sqlite3_io_methods*, sqlite3_io_methods> made;
    static const sqlite3_io_methods* system = &of;
    const std::scoped_lock lock(mutex);
    auto [at, is_new] = made.try_emplace(&of, of);
    if (is_new) {
      at->second.xSync = [](sqlite3_file* file, int flags) {
        while (stuck) std::this_thread::sleep_for(std::chrono::milliseconds(20));
        return system->xSync(file, flags);
      };
    }
    return at->second;
  }
  sqlite3_vfs* system_;
  sqlite3_vfs disk_;
};

}  // namespace anchord
