#include "server/app/model_key.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>

#include "api/learning/model_signer.hpp"

namespace anchord::server {
namespace {

Result<ModelKey> make(const std::filesystem::path& file) {
  ModelKey key{api::ModelSigner::to_text(api::ModelSigner::random_seed()), true};
  const std::string text = key.text + "\n";
  // Beside and renamed: a crash leaves no half key, and a link is not followed.
  const std::string part = file.string() + ".part";
  ::unlink(part.c_str());
  const int fd = ::open(part.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600);
  const bool written = fd >= 0 &&
                       ::write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size()) &&
                       ::fsync(fd) == 0;
  const std::string why = std::strerror(errno);
  if (fd >= 0) ::close(fd);
  if (!written || ::rename(part.c_str(), file.c_str()) != 0)
    return make_error(Errc::storage_unavailable, "cannot write " + file.string() + ": " + why);
  return key;
}

}  // namespace

Result<ModelKey> read_or_make_model_key(const std::filesystem::path& data_dir) {
  const auto file = data_dir / k_model_key_file;
  struct stat info {};
  if (::lstat(file.c_str(), &info) != 0) {
    if (errno == ENOENT) return make(file);
    return make_error(Errc::storage_unavailable,
                      "cannot read " + file.string() + ": " + std::strerror(errno));
  }
  if (!S_ISREG(info.st_mode) || (info.st_mode & 077) != 0)
    return make_error(
        Errc::invalid_argument,
        file.string() + " must be readable by its owner only: chmod 600, or remove it to create a new key");
  std::ifstream in(file, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(in), {}};
  const auto seed = api::ModelSigner::parse_seed(text);
  if (!in || !seed)
    return make_error(Errc::invalid_argument,
                      file.string() +
                          " is not 64 hex digits: bring it back from a copy, or remove it for a new key "
                          "(models signed with the old one are then evaluated again before they are used)");
  return ModelKey{api::ModelSigner::to_text(seed.value()), false};
}

}  // namespace anchord::server
