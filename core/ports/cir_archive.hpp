#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// The file that has the impulse responses of one flight.
struct ArchivedCirs {
  MissionId mission{};
  std::string mission_name;
  std::string file;   ///< its name
  std::string place;  ///< machine and folder where it was written: "tower:/var/lib/anchord/cir-archive"
  std::string sha256_hex;
  std::uint64_t n_cirs{};   ///< in the file
  std::uint64_t n_moved{};  ///< of these, no longer in the database
  std::uint64_t file_bytes{};
  UtcTime archived{};
  bool held{};  ///< brought back by somebody, and not moved again by the rule
  bool here{};  ///< the file is in the folder of this process
};

/// Impulse responses of landed flights that are moved out of the database into files. Whoever reads a range
/// gets its impulse response as before; where the file is not there, storage_unavailable says which and
/// where. A row leaves the database only after the file that has it was synced and read back, and by the
/// same digest; a process that dies at any point leaves each response in at least one of the two.
/// Thread-safe, blocks; one call of archive() or bring_back() at a time (conflict).
class CirArchive {
 public:
  /// Asked before each step, which is short; it may wait. False: stop here, with Errc::canceled.
  using GoOn = std::function<bool()>;

  virtual ~CirArchive() = default;
  /// Flights that landed before this time and have ranges that archive() has not gone through, the longest
  /// landed first. Not those that somebody brought back.
  virtual Result<std::vector<MissionId>> due(UtcTime landed_before, std::size_t most) = 0;
  /// Moves all impulse responses of a landed flight into its file. errors: not_found, conflict (it is not
  /// finished), storage_full, storage_unavailable, canceled.
  virtual Result<ArchivedCirs> archive(const MissionId& mission, UtcTime now, const GoOn& go_on) = 0;
  /// Moves them back; the file stays. errors: not_found, storage_full, storage_unavailable, canceled.
  virtual Result<ArchivedCirs> bring_back(const MissionId& mission, const GoOn& go_on) = 0;
  /// Flights with a file, last written first.
  virtual Result<std::vector<ArchivedCirs>> list() = 0;
};

}  // namespace anchord
