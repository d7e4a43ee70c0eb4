#pragma once

#include <optional>
#include <vector>

#include "core/localize/live_track.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/fix.hpp"

namespace anchord::flight {

/// Which fixes the pilot may believe while the rows of a mission are read again and its LiveMission takes
/// none: the aircraft is in the air, and two seconds without a position are a hold. Judged as in flight
/// (LiveTrack), against the last fix that was believed before. Not thread-safe.
class FixCheck {
 public:
  /// last  believed before the rows were read again; none: the first fix is believed, as at a start
  FixCheck(TrackFrame frame, const TrackLimits& limits, std::vector<Exclusion> exclusions,
           const std::optional<Fix>& last);
  /// False: no aircraft could be there, or the row is excluded.
  bool believes(const Fix& fix);

 private:
  LiveTrack track_;
  std::vector<Exclusion> exclusions_;
};

}  // namespace anchord::flight
