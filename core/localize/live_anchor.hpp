#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/geo/enu.hpp"
#include "core/localize/live_flight.hpp"
#include "core/localize/observation.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// One anchor of a live flight: its rows, thinned to a bound, and its warm estimate. Used by LiveFlight
/// alone.
class LiveAnchor {
 public:
  explicit LiveAnchor(NetworkId id) { estimate_.anchor = id; }

  void refuse(const std::string& why) { ++estimate_.refused[why]; }
  /// True when the estimate was solved anew: at most every update_interval_s of measurement time.
  bool add(const Observation& row, UtcTime time, const LiveOptions& options);
  /// Solves with all rows; false when there is nothing new.
  bool solve(const LiveOptions& options);
  std::optional<double> residual_m(const Observation& row) const;
  /// With WGS84 filled where there is a frame.
  Estimate estimate(const std::optional<EnuFrame>& frame) const;

 private:
  void thin(std::size_t max_rows);
  void search(const LiveOptions& options);
  void describe(const LiveOptions& options);

  std::vector<Observation> rows_;
  std::size_t stride_{1}, skipped_{0};  ///< every stride-th row is kept, so that old and new count alike
  std::size_t used_{0}, used_at_solve_{0};
  std::optional<Eigen::Vector3d> position_m_;
  double bias_m_{0};
  std::optional<UtcTime> first_, newest_, solved_;
  std::size_t rows_at_search_{0};
  Estimate estimate_;
};

}  // namespace anchord
