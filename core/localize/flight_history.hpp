#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "core/types/flight_data.hpp"

namespace anchord {

/// The rows of a flight in the air, for a joint solution now and then. Bounded: when full, every second row
/// goes, old and new alike, and from then on only every second (fourth, ...) comes in. Not thread-safe.
class FlightHistory {
 public:
  /// A track of 10 Hz is whole for 10 minutes, so that memory is flat from then on, and every 0.2 s for
  /// another 10: at 1 m/s^2 a straight line between two of those is 5 mm off. The answer after landing uses
  /// all rows.
  static constexpr std::size_t k_max_ranges = 24'000, k_max_fixes = 6'000;

  /// `error_model`: what a model says of the range as it is given here.
  void add(const Range& range, const std::optional<RangeErrorModel>& error_model = {});
  void add(const Fix& fix);
  /// A copy for a solver on another thread.
  FlightData data(const Mission& mission) const;
  std::size_t n_ranges() const { return ranges_.size(); }
  UtcTime newest() const { return newest_; }  ///< of the ranges
  void clear();

 private:
  std::vector<Range> ranges_;
  std::vector<std::optional<RangeErrorModel>>
      error_models_;  ///< empty until a model spoke, then one for each range
  std::vector<Fix> fixes_;
  std::size_t range_stride_{1}, fix_stride_{1}, ranges_seen_{0}, fixes_seen_{0};
  UtcTime newest_{};
};

}  // namespace anchord
