#pragma once
#include <filesystem>
#include <fstream>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord {

/// A file that is there whole or not at all: written beside its place and moved there. Where that fails (a
/// full disk) what was there before is there still, and nothing half is left. A link is followed; what is no
/// file (a device, a pipe) is written to as it is.
class WholeFile {
 public:
  explicit WholeFile(const std::filesystem::path& file);
  /// Not put in its place: as if it had never been.
  ~WholeFile();
  WholeFile(const WholeFile&) = delete;
  WholeFile& operator=(const WholeFile&) = delete;

  std::ofstream& out() { return out_; }
  /// Errc::storage_unavailable with the name of the file and why it cannot be written.
  Result<void> put_in_place();

 private:
  std::filesystem::path file_;    ///< as it was named
  std::filesystem::path place_;   ///< behind its links
  std::filesystem::path beside_;  ///< empty: written in its place
  std::ofstream out_;
};

/// All of it at once; the same errors.
Result<void> write_whole(const std::filesystem::path& file, std::string_view text);

}  // namespace anchord
