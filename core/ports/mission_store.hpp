#pragma once

#include <optional>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/mission.hpp"

namespace anchord {

/// Flights, newest first in lists (`after`: the last id of the page before): in order of insertion, whatever
/// the clock said. insert answers storage_full already when little space is left, so that a flight that runs
/// can finish. Deleting is MissionBin's (core/ports/mission_bin.hpp).
class MissionStore {
 public:
  virtual ~MissionStore() = default;
  virtual Result<void> insert(const Mission& mission) = 0;
  virtual Result<void> update(const Mission& mission) = 0;
  /// The mission as it is then; conflict when it was finished already.
  virtual Result<Mission> finish(const MissionId& id, UtcTime now) = 0;
  virtual Result<Mission> mission(const MissionId& id) = 0;
  virtual Result<std::vector<Mission>> missions(std::size_t limit, const std::optional<MissionId>& after) = 0;
};

}  // namespace anchord
