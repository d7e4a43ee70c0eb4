#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "core/base/result.hpp"

namespace anchord::sync {

/// A file without a name, for what is too large to hold: what is killed here leaves nothing behind.
class Spool {
 public:
  /// On the disk of this folder; where that cannot be, in /tmp. errors: storage_full, storage_unavailable
  static Result<Spool> make(const std::filesystem::path& folder);

  /// The file of this name, as it is, that no other process has: what is killed here leaves it for the next
  /// run. errors: conflict (another has it), storage_full, storage_unavailable
  static Result<Spool> named(const std::filesystem::path& file);

  std::FILE* file() const { return file_.get(); }
  /// For who opens it by name.
  std::string path() const;
  std::uint64_t bytes() const;

 private:
  struct Close {
    void operator()(std::FILE* file) const { std::fclose(file); }
  };
  explicit Spool(std::FILE* file) : file_(file) {}
  std::unique_ptr<std::FILE, Close> file_;
};

/// SHA-256 of all of it, in hex. errors: storage_unavailable
Result<std::string> digest_of(const Spool& file);

std::string megabytes(std::uint64_t bytes);

/// The text of a bundle's manifest. errors: those of the zip file
Result<std::string> manifest_of(const Spool& bundle);

}  // namespace anchord::sync
