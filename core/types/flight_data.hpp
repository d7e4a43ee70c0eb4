#pragma once

#include <cstdint>
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

/// Of a range what a solve asks, in a quarter of its memory.
struct FlightRange {
  UtcTime time{};
  double distance_m{};
  std::optional<std::uint64_t> seq{};
  std::optional<double> rss_dbm{};  ///< total received power where the radio gives no RSS
  NetworkId tag{};                  ///< the other anchor when kind == anchor_anchor
  NetworkId anchor{};
  std::uint8_t antenna{0};
  RangeKind kind{RangeKind::tag_anchor};
};
inline FlightRange flight_range(const Range& range) {
  return {range.time, range.distance_m, range.seq,     range.rss_dbm ? range.rss_dbm : range.rx_dbm,
          range.tag,  range.anchor,     range.antenna, range.kind};
}

/// Everything one flight recorded: what a solver takes and a reader of files or a store gives.
struct FlightData {
  Mission mission;
  std::vector<Fix> fixes;                         ///< any order
  std::vector<Range> ranges;                      ///< any order
  std::vector<FlightRange> rows{};                ///< in place of `ranges`, where only a solve is wanted
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

  std::size_t n_ranges() const { return rows.empty() ? ranges.size() : rows.size(); }
  FlightRange range(std::size_t i) const { return rows.empty() ? flight_range(ranges[i]) : rows[i]; }
  /// Keeps of the ranges what a solve asks, and no more.
  void keep_rows();
};

inline void FlightData::keep_rows() {
  rows.reserve(rows.size() + ranges.size());
  for (const Range& range : ranges) rows.push_back(flight_range(range));
  ranges = {};
}

}  // namespace anchord
