#include "server/sync/spool.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "api/formats/bundle_manifest.hpp"
#include "core/base/sha256.hpp"

namespace anchord::sync {
namespace {

constexpr std::uint64_t k_manifest_bytes = 1u << 20;
constexpr std::size_t k_piece_bytes = std::size_t{1} << 18;
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

Result<Spool> Spool::named(const std::filesystem::path& file) {
  const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600);
  std::FILE* const opened = fd >= 0 ? ::fdopen(fd, "r+b") : nullptr;
  if (opened == nullptr)
    return make_error(errno == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
                      "cannot open " + file.string() + ": " + std::strerror(errno));
  Spool out(opened);
  if (::flock(fd, LOCK_EX | LOCK_NB) != 0)
    return make_error(Errc::conflict, file.string() + " is in use by another process");
  return out;
}

std::string Spool::path() const { return "/proc/self/fd/" + std::to_string(::fileno(file_.get())); }

std::uint64_t Spool::bytes() const {
  struct stat status {};
  if (std::fflush(file_.get()) != 0 || ::fstat(::fileno(file_.get()), &status) != 0) return 0;
  return static_cast<std::uint64_t>(status.st_size);
}

Result<std::string> digest_of(const Spool& file) {
  Sha256 sum;
  std::vector<char> piece(k_piece_bytes);
  if (std::fseek(file.file(), 0, SEEK_SET) != 0)
    return make_error(Errc::storage_unavailable, "cannot read a bundle again");
  while (const auto n = std::fread(piece.data(), 1, piece.size(), file.file())) sum.add({piece.data(), n});
  if (std::ferror(file.file()) != 0)
    return make_error(Errc::storage_unavailable, "cannot read a bundle again");
  return sum.hex();
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
