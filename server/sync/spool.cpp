#include "server/sync/spool.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "api/formats/bundle_manifest.hpp"

namespace anchord::sync {
namespace {

constexpr std::uint64_t k_manifest_bytes = 1u << 20;
constexpr std::size_t k_most_entries = 5064;  ///< of a site's bundle (docs/formats.md)

}  // namespace

Result<Spool> Spool::make(const std::filesystem::path& folder) {
  const int fd = ::open(folder.empty() ? "." : folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  std::FILE* file = fd >= 0 ? ::fdopen(fd, "w+b") : std::tmpfile();
  if (file != nullptr) return Spool(file);
  return make_error(
      errno == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
      "cannot make a file for a bundle in " + folder.string() + " or /tmp: " + std::strerror(errno));
}

std::string Spool::path() const { return "/proc/self/fd/" + std::to_string(::fileno(file_.get())); }

std::uint64_t Spool::bytes() const {
  struct stat status {};
  if (std::fflush(file_.get()) != 0 || ::fstat(::fileno(file_.get()), &status) != 0) return 0;
  return static_cast<std::uint64_t>(status.st_size);
}

std::string megabytes(std::uint64_t bytes) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f MB", static_cast<double>(bytes) / 1e6);
  return text;
}

Result<std::string> manifest_of(const Spool& bundle) {
  BOOST_OUTCOME_TRY(const auto zip, api::ZipReader::open(bundle.path(), {.entries = k_most_entries}));
  return zip.text(api::k_bundle_manifest, k_manifest_bytes);
}

}  // namespace anchord::sync
