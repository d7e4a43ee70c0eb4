#include "api/formats/gzip_lines.hpp"

#include <zlib.h>

namespace anchord::api {
namespace {
constexpr std::size_t k_max_line = 1 << 20;
constexpr std::size_t k_chunk = 1 << 16;
constexpr std::uint64_t k_max_total = std::uint64_t{4} << 30;
}  // namespace

struct GzipLines::File {
  gzFile handle{};
  ~File() { gzclose_r(handle); }
};

GzipLines::GzipLines(std::unique_ptr<File> file, std::string name)
    : file_{std::move(file)}, name_{std::move(name)} {}
GzipLines::GzipLines(GzipLines&&) noexcept = default;
GzipLines& GzipLines::operator=(GzipLines&&) noexcept = default;
GzipLines::~GzipLines() = default;

Result<GzipLines> GzipLines::open(const std::filesystem::path& path) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path, ignored))
    return make_error(Errc::not_found, path.string() + ": no such file");
  const gzFile handle = gzopen(path.c_str(), "rb");
  if (handle == nullptr) return make_error(Errc::not_found, path.string() + ": cannot be read");
  gzbuffer(handle, 1 << 17);
  auto file = std::make_unique<File>();
  file->handle = handle;
  return GzipLines{std::move(file), path.string()};
}

Result<bool> GzipLines::next(std::string_view& line) {
  std::size_t searched = at_;
  while (true) {
    const auto end = buffer_.find('\n', searched);
    if (end != std::string::npos || (ended_ && at_ < buffer_.size())) {
      const std::size_t stop = end == std::string::npos ? buffer_.size() : end;
      line = std::string_view{buffer_}.substr(at_, stop - at_);
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      at_ = end == std::string::npos ? stop : stop + 1;
      ++line_number_;
      return true;
    }
    if (ended_) return false;
    if (buffer_.size() - at_ > k_max_line)
      return make_error(Errc::bad_frame,
                        name_ + ": line " + std::to_string(line_number_ + 1) + " is longer than 1 MiB");
    buffer_.erase(0, at_);
    at_ = 0;
    searched = buffer_.size();
    buffer_.resize(searched + k_chunk);
    const int got = gzread(file_->handle, buffer_.data() + searched, k_chunk);
    buffer_.resize(searched + static_cast<std::size_t>(got > 0 ? got : 0));
    total_ += static_cast<std::uint64_t>(got > 0 ? got : 0);
    if (total_ > k_max_total) return make_error(Errc::bad_frame, name_ + ": more than 4 GiB of text");
    int state = Z_OK;
    const char* what = gzerror(file_->handle, &state);
    if (got < 0 || (got == 0 && state != Z_OK && state != Z_STREAM_END))
      return make_error(Errc::bad_frame,
                        name_ + ": damaged after line " + std::to_string(line_number_) + ": " + what);
    if (got == 0) ended_ = true;
  }
}

}  // namespace anchord::api
