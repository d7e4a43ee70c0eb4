#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"
#include "core/types/range_error_model.hpp"

namespace anchord {

/// Everything one flight recorded: what a solver takes and a reader of files or a store gives.
struct FlightData {
  Mission mission;
  std::vector<Fix> fixes;                         ///< any order
  std::vector<Range> ranges;                      ///< any order
  std::map<NetworkId, std::string> anchor_names;  ///< id text as the source wrote it
  /// What a model believes of each range: empty, or one for every range, in their order.
  std::vector<std::optional<RangeErrorModel>> error_models{};
  /// Distances as received, where a model corrected those of the ranges: empty, or one for every range.
  std::vector<double> received_m{};
  /// Left out by a person before anything else was looked at, by anchor; they are counted as "excluded".
  std::map<NetworkId, std::size_t> n_ranges_excluded{};
  std::size_t n_fixes_excluded{};
  std::vector<Exclusion> exclusions{};  ///< of its record, those taken back too
  std::vector<std::string> notes;       ///< what the reader saw and did not use, for people
};

}  // namespace anchord
