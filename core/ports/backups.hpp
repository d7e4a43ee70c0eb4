#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// A copy of the database that passed its checks.
struct Backup {
  std::string name;          ///< of the file: its number, and the time it was made
  std::uint64_t sequence{};  ///< which is newer; 0 for files of before there were numbers
  UtcTime made{};            ///< by the system clock as it stood then; decides nothing
  std::uint64_t bytes{};
  std::string sha256_hex;
  std::optional<bool> good{};  ///< its digest and integrity were checked by this process; absent: not yet
  std::size_t cir_files{};     ///< files of impulse responses that it needs and has
  std::uint64_t cir_bytes{};
  std::vector<std::string> cir_missing{};  ///< those that it needs and has not, with the reason; empty: whole
};

/// How the copies go, without a look at the disk.
struct BackupState {
  std::optional<UtcTime> newest{};  ///< when the newest was made, by the system clock; absent: none is known
  std::string failure{};            ///< why the last attempt made none; empty: it made one
};

/// Copies of the database on disk. Thread-safe.
class Backups {
 public:
  virtual ~Backups() = default;
  /// Makes one while writes go on, checks it, and drops those older than the newest so many that are whole.
  /// Takes seconds, and where files of impulse responses are copied for the first time as long as a disk
  /// needs for them. False from `go_on`: stop.
  /// Errors: storage_full, storage_unavailable, conflict (one is being made), canceled.
  virtual Result<Backup> make(const std::function<bool()>& go_on) = 0;
  virtual std::vector<Backup> list() const = 0;  ///< newest first, by sequence
  virtual BackupState state() const = 0;
  /// Whether one is to be begun now: the newest is older than the schedule wants, or a flight ended since the
  /// last was begun (`flights_ended` only grows). Never while the schedule is off, at most each ten minutes.
  virtual bool due(std::uint64_t flights_ended) = 0;
  /// Why none is ever made here; nothing where they are.
  virtual std::optional<Error> refusal() const { return std::nullopt; }
};

}  // namespace anchord
