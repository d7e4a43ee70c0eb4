#pragma once

#include <cstdint>
#include <filesystem>

namespace anchord {

/// Which file a path names, to find out later whether it still does. A file that was removed, renamed or
/// replaced while it is open takes what is written as before, without an error, and whoever opens the path
/// afterwards finds none of it.
class FilePlace {
 public:
  explicit FilePlace(std::filesystem::path file);
  /// The path names the file that it named at the construction. A path that named none never holds.
  bool holds() const;

 private:
  std::filesystem::path file_;
  std::uint64_t device_{0};
  std::uint64_t inode_{0};  ///< of an open file no other file gets it; 0: there was none
};

}  // namespace anchord
