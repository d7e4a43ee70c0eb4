#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord::api {

/// Lines of a text file, gzipped or plain (told by its content). A line longer than 1 MiB, a truncated or
/// damaged gzip stream and more than 4 GiB of text are errors.
class GzipLines {
 public:
  static Result<GzipLines> open(const std::filesystem::path& path);
  GzipLines(GzipLines&&) noexcept;
  GzipLines& operator=(GzipLines&&) noexcept;
  ~GzipLines();

  /// The next line without its end; false at the end of the file. The view lives until the next call.
  Result<bool> next(std::string_view& line);
  std::size_t line_number() const { return line_number_; }  ///< of the line last given, from 1

 private:
  struct File;
  explicit GzipLines(std::unique_ptr<File> file, std::string name);
  std::unique_ptr<File> file_;
  std::string name_;
  std::string buffer_{};
  std::size_t at_{0};
  std::size_t line_number_{0};
  std::uint64_t total_{0};
  bool ended_{false};
};

}  // namespace anchord::api
