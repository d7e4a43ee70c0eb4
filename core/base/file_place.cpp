#include "core/base/file_place.hpp"

#include <sys/stat.h>

#include <utility>

namespace anchord {

FilePlace::FilePlace(std::filesystem::path file) : file_(std::move(file)) {
  struct stat found {};
  if (::stat(file_.c_str(), &found) != 0) return;
  device_ = found.st_dev;
  inode_ = found.st_ino;
}

bool FilePlace::holds() const {
  struct stat found {};
  return inode_ != 0 && ::stat(file_.c_str(), &found) == 0 && found.st_dev == device_ &&
         found.st_ino == inode_;
}

}  // namespace anchord
