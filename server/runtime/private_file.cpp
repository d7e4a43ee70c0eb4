#include "server/runtime/private_file.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/storage/data_folder.hpp"

namespace anchord::server {

Result<void> write_private(const std::filesystem::path& file, const std::string& text) {
  const std::filesystem::path part = file.string() + ".part";
  const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600);
  const bool written = fd >= 0 &&
                       ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       ::fsync(fd) == 0;
  const int failure = errno;
  if (fd >= 0) ::close(fd);
  std::error_code error;
  if (written) std::filesystem::rename(part, file, error);
  // A name that is not synced is the old file again after a power cut.
  const bool named = written && !error && sql::sync_path(std::filesystem::absolute(file).parent_path());
  if (!named) {
    return make_error(
        failure == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
        "cannot write " + file.string() + ": " + (error ? error.message() : std::strerror(failure)));
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::server
