#include "core/base/whole_file.hpp"

#include <cerrno>
#include <cstring>
#include <string>

namespace anchord {

namespace fs = std::filesystem;

WholeFile::WholeFile(const fs::path& file) : file_(file), place_(file) {
  std::error_code unknown;
  if (fs::is_symlink(file, unknown)) place_ = fs::weakly_canonical(file, unknown);
  if (unknown) place_ = file;
  const auto there = fs::status(place_, unknown);
  if (!fs::exists(there) || fs::is_regular_file(there)) (beside_ = place_) += ".part";
  errno = 0;
  out_.open(beside_.empty() ? place_ : beside_, std::ios::binary);
}

WholeFile::~WholeFile() {
  if (beside_.empty()) return;
  out_.close();
  std::error_code gone;
  fs::remove(beside_, gone);
}

Result<void> WholeFile::put_in_place() {
  // Of a stream that failed before, the first reason is lost; what is known of the last one is better than
  // nothing.
  const bool good = out_.is_open() && static_cast<bool>(out_.flush());
  const int why = errno;
  out_.close();
  std::error_code failed;
  if (good && out_ && !beside_.empty()) {
    const auto before = fs::status(place_, failed);
    if (fs::exists(before)) fs::permissions(beside_, before.permissions(), failed);
    fs::rename(beside_, place_, failed);
    if (!failed) beside_.clear();
  }
  if (good && out_ && !failed) return boost::outcome_v2::success();
  const std::string reason = failed ? failed.message() : why != 0 ? std::strerror(why) : "";
  return make_error(Errc::storage_unavailable,
                    file_.string() + ": cannot be written" + (reason.empty() ? "" : ": " + reason));
}

Result<void> write_whole(const fs::path& file, std::string_view text) {
  WholeFile whole(file);
  whole.out() << text;
  return whole.put_in_place();
}

}  // namespace anchord
