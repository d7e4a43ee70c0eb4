#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// A copy of the database that passed its checks.
struct Backup {
  std::string name;  ///< of the file; the time it was made is in it
  UtcTime made{};
  std::uint64_t bytes{};
  std::string sha256_hex;
};

/// Copies of the database on disk. Thread-safe.
class Backups {
 public:
  virtual ~Backups() = default;
  /// Makes one while writes go on, checks it, and drops the oldest beyond those to keep. Takes seconds.
  /// Errors: storage_full, storage_unavailable, conflict (one is being made).
  virtual Result<Backup> make() = 0;
  virtual std::vector<Backup> list() const = 0;  ///< newest first
  /// Whether one is to be begun now: the newest is older than the schedule wants, or a flight ended since the
  /// last was begun (`flights_ended` only grows). Never while the schedule is off, at most each ten minutes.
  virtual bool due(std::uint64_t flights_ended) = 0;
};

}  // namespace anchord
