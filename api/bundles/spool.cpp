#include "api/bundles/spool.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <vector>

#include "api/kit/problem.hpp"

namespace anchord::api {
namespace {

constexpr std::size_t k_part_bytes = std::size_t{1} << 18;

Error cannot_write(const std::filesystem::path& path, int why) {
  return make_error(why == ENOSPC ? Errc::storage_full : Errc::storage_unavailable,
                    "cannot write " + path.filename().string() + " for this request: " + std::strerror(why));
}

}  // namespace

Result<std::shared_ptr<SpoolFolder>> SpoolFolder::make(const std::filesystem::path& root) {
  std::error_code error;
  std::filesystem::create_directories(root, error);
  if (error) return cannot_write(root, error.value());
  std::string name = (root / "XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) return cannot_write(root, errno);  // 0700
  return std::make_shared<SpoolFolder>(std::filesystem::path(name));
}

SpoolFolder::~SpoolFolder() {
  std::error_code error;
  std::filesystem::remove_all(dir_, error);
}

std::uint64_t spool_body(const Request& request, const std::filesystem::path& file) {
  std::ofstream out(file, std::ios::binary);
  std::uint64_t total = 0;
  const auto write = [&](const char* bytes, std::size_t n) {
    errno = 0;
    if (!out.write(bytes, static_cast<std::streamsize>(n)))
      throw ProblemException{problem_of(cannot_write(file, errno))};
    total += n;
  };
  if (request.body_stream == nullptr) {
    write(request.body.data(), request.body.size());
  } else {
    std::vector<char> part(k_part_bytes);
    for (std::size_t n; (n = request.body_stream->read(part)) > 0;) write(part.data(), n);
  }
  errno = 0;
  out.close();
  if (!out) throw ProblemException{problem_of(cannot_write(file, errno))};
  return total;
}

Response file_answer(std::shared_ptr<SpoolFolder> folder, const std::filesystem::path& file,
                     std::string_view type, const std::string& name) {
  auto in = std::make_shared<std::ifstream>(file, std::ios::binary);
  if (!*in) throw ProblemException{problem_of(cannot_write(file, errno))};
  Response response;
  response.header("Content-Type", std::string(type));
  response.header("Content-Disposition", "attachment; filename=\"" + name + '"');
  response.body_stream = [folder = std::move(folder), in] {
    std::string part(k_part_bytes, '\0');
    in->read(part.data(), static_cast<std::streamsize>(part.size()));
    part.resize(static_cast<std::size_t>(std::max<std::streamsize>(0, in->gcount())));
    return part;
  };
  return response;
}

}  // namespace anchord::api
