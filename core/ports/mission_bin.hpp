#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/mission.hpp"

namespace anchord {

/// A deleted mission that can still be brought back.
struct BinnedMission {
  Mission mission;
  UtcTime deleted{};
  std::int64_t deleted_ran_ns{};  ///< running time of the service then: what its days in the bin count in
  std::string deleted_by;
  std::uint64_t n_ranges{}, n_fixes{};
  bool emptying{};  ///< its rows are being removed; too late to restore
};

/// The bin of deleted missions. What is in it does not exist for any other port: MissionStore does not list
/// it, its rows match no query, appends to it are of an unknown mission. Thread-safe, blocks.
class MissionBin {
 public:
  virtual ~MissionBin() = default;
  /// Errors: not_found; conflict while it records, or when a calibration was made from it.
  virtual Result<void> put(const MissionId& id, UtcTime now, std::int64_t ran_ns, std::string_view by) = 0;
  /// Errors: not_found (not in the bin), conflict (being emptied).
  virtual Result<void> restore(const MissionId& id) = 0;
  virtual Result<BinnedMission> binned(const MissionId& id) = 0;
  /// Last deleted first.
  virtual Result<std::vector<BinnedMission>> list() = 0;
  /// Marks one, or all that were deleted before this running time, for removal. Says how many were marked.
  virtual Result<void> empty(const MissionId& id) = 0;
  virtual Result<std::size_t> empty_before(std::int64_t ran_ns) = 0;
  /// Removes at most so many rows of what is marked, and a mission with its last one; 0: nothing is left.
  /// Each call is one short transaction, so that ingest never waits for a whole flight.
  virtual Result<std::size_t> remove_rows(std::size_t most) = 0;
};

/// What the service remembers over a restart beside its records. Thread-safe, blocks.
class ServiceStore {
 public:
  virtual ~ServiceStore() = default;
  /// How long this database has been served, over all starts.
  virtual Result<std::int64_t> running_ns() = 0;
  virtual Result<void> keep_running_ns(std::int64_t ns) = 0;  ///< never goes back
  /// Missions that have, or get back, the rows of this server's devices; the last one has them now.
  virtual Result<std::vector<MissionId>> device_stream() = 0;
  virtual Result<void> keep_device_stream(const std::vector<MissionId>& missions) = 0;
};

}  // namespace anchord
