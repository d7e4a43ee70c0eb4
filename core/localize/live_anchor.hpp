#pragma once

#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/geo/enu.hpp"
#include "core/localize/live_flight.hpp"
#include "core/localize/observation.hpp"
#include "core/localize/warm_solve.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

struct AnchorSolution;
struct GeometryReport;
struct SharedSolution;

/// One anchor of a live flight: its rows as received, thinned to a bound, and its warm estimate: an own
/// search until a joint solution of the flight is adopted, and from then on that solution refined by every
/// range since. Used by LiveFlight alone.
class LiveAnchor {
 public:
  explicit LiveAnchor(NetworkId id) { estimate_.anchor = id; }

  void refuse(const std::string& why, std::size_t n = 1) { estimate_.refused[why] += n; }
  /// A refusal taken back: the fixes came after all.
  void forgive(const std::string& why);
  /// True when the estimate was solved anew: at most every update_interval_s of measurement time.
  bool add(const Observation& row, UtcTime time, const LiveOptions& options, bool held = false);
  /// Solves with all rows; false when there is nothing new.
  bool solve(const LiveOptions& options);
  /// Takes over a joint solution of the rows up to `cut`; false when it has no position for this anchor, and
  /// then the own search goes on.
  bool adopt(const AnchorSolution& solution, const SharedSolution& shared, UtcTime cut);
  /// What is to be taken off a range of this length, as far as known.
  double correction_m(double distance_m, const LiveOptions& options) const;
  std::optional<double> residual_m(const Observation& row, const LiveOptions& options) const;
  /// With WGS84 filled where there is a frame.
  Estimate estimate(const std::optional<EnuFrame>& frame) const;

 private:
  void thin(std::size_t max_rows);
  Result<AnchorFit> search(RangeBlock& block, const SolverOptions& settings);
  bool can_be_solved(const GeometryReport& geometry);
  void describe(RangeBlock& block, const Result<AnchorFit>& fit, const LiveOptions& options);
  void refine();

  /// What a joint solution said, refined by the ranges since.
  struct Joint {
    Estimate estimate;
    Eigen::Matrix3d information_per_m2;  ///< of the fit, without the floor
    Eigen::Matrix3d floor_m2;
    double bias_m{}, curve_m{};  ///< bias with the delay of this unit
    double scale_m{};            ///< robust, of the residuals
    double rows_per_look{1};     ///< tempering of the likelihood
  };
  struct Recent {
    Observation row;
    UtcTime time;
  };
  std::optional<Joint> joint_;
  std::deque<Recent> recent_;  ///< rows no joint solution has seen yet
  std::vector<Observation> rows_;
  std::size_t stride_{1}, skipped_{0};  ///< every stride-th row is kept, so that old and new count alike
  std::size_t used_{0}, used_at_solve_{0};
  std::optional<Eigen::Vector3d> position_m_;
  double bias_m_{0};
  std::optional<WarmStart> mirror_;  ///< of the last solve; none: the next looks for it anew
  std::optional<UtcTime> first_, newest_, solved_;
  std::size_t rows_at_search_{0};
  Estimate estimate_;
};

}  // namespace anchord
