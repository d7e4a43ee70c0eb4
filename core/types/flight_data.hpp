#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// Everything one flight recorded: what a solver takes and a reader of files or a store gives.
struct FlightData {
  Mission mission;
  std::vector<Fix> fixes;                         ///< any order
  std::vector<Range> ranges;                      ///< any order
  std::map<NetworkId, std::string> anchor_names;  ///< id text as the source wrote it
  std::vector<std::string> notes;                 ///< what the reader saw and did not use, for people
};

}  // namespace anchord
