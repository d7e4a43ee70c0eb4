#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/gateway/outbox.hpp"

namespace anchord::gateway {

struct RejectedRow {
  MissionId mission{};
  Lines lines{};
  std::string line, code, detail;  ///< as it was sent; why the server did not take it
};

/// DIR/rejected.ndjson: rows that the server does not take, each with the reason, for a person. At 64 MiB it
/// becomes rejected.old.ndjson, in the place of the one before. One thread.
class RejectedFile {
 public:
  explicit RejectedFile(const std::filesystem::path& dir) : dir_(dir) {}
  /// On the disk when it returns. Errors: storage_full, storage_unavailable
  Result<void> append(const std::vector<RejectedRow>& rows, UtcTime now);
  std::filesystem::path path() const { return dir_ / "rejected.ndjson"; }

 private:
  std::filesystem::path dir_;
};

}  // namespace anchord::gateway
