#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/result.hpp"

namespace anchord::api {

/// A folder of one request for files that are too large to hold; goes with its last owner. Only the server's
/// user can read it.
class SpoolFolder {
 public:
  /// errors: storage_unavailable, storage_full
  static Result<std::shared_ptr<SpoolFolder>> make(const std::filesystem::path& root);
  explicit SpoolFolder(std::filesystem::path dir) : dir_(std::move(dir)) {}
  ~SpoolFolder();
  SpoolFolder(const SpoolFolder&) = delete;
  SpoolFolder& operator=(const SpoolFolder&) = delete;

  std::filesystem::path path(std::string_view name) const { return dir_ / name; }

 private:
  const std::filesystem::path dir_;
};

/// The body of a request in a file; says how many bytes. Throws what the body's reader throws, and 507 or 503
/// where it cannot be written.
std::uint64_t spool_body(const Request& request, const std::filesystem::path& file);

/// A file as an answer, read while it is sent; the folder is kept until then.
Response file_answer(std::shared_ptr<SpoolFolder> folder, const std::filesystem::path& file,
                     std::string_view type, const std::string& name);

}  // namespace anchord::api
