#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

#include "api/kit/message.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord::api {

/// A bundle that comes in parts.
struct Upload {
  std::string id;  ///< a UUID; the same for the same token, size and digest
  std::string token_id, sha256_hex;
  std::uint64_t bytes{};   ///< of the whole
  std::uint64_t offset{};  ///< bytes that are here
  UtcTime expires{};       ///< two days after the last byte
  std::filesystem::path file;
};

/// Files in a folder, each with a note of whose it is: they survive a restart. A token sees its own alone and
/// has at most 4 of 4 GiB together, a new one takes the place of its oldest; all tokens have 64 of 16 GiB,
/// and 256 MiB of the disk stay free once all that was announced is here. Any thread.
class UploadStore {
 public:
  explicit UploadStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  struct Begun {
    Upload upload;
    bool is_new{};
  };
  /// The one that is here already, or a new one. errors: queue_full, storage_full, storage_unavailable
  Result<Begun> begin(const std::string& token_id, std::uint64_t bytes, const std::string& sha256_hex) const;
  /// errors: not_found, also where it is another token's
  Result<Upload> find(const std::string& token_id, std::string_view id) const;
  /// Adds a body at the offset, which must be the upload's; what comes before a cut stays. Two that write at
  /// once write the same bytes in the same place, or the digest of the whole will not be right. Answers the
  /// new offset. Throws what the body's reader throws. errors: invalid_argument (more than the
  /// whole), storage_full, storage_unavailable
  Result<std::uint64_t> add(const Upload& upload, const Request& request) const;
  void remove(const Upload& upload) const;

 private:
  std::optional<Upload> read(const std::string& id) const;
  std::filesystem::path note_of(std::string_view id) const;
  std::filesystem::path part_of(std::string_view id) const;
  const std::filesystem::path folder_;
};

}  // namespace anchord::api
