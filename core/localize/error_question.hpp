#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "core/localize/joint_model.hpp"
#include "core/types/estimate.hpp"

namespace anchord {

/// Errors that all residuals of a fit may hide.
enum class ErrorKind : std::uint8_t {
  factor,         ///< on the ranges
  step,           ///< of the ranges, between the lower and the upper half of the heights flown
  drift,          ///< of the ranges in time
  track_heights,  ///< a factor on the heights of the track
  track_drift,    ///< of the track in time
};
/// Ways in which a track drifts along an axis of the answer: a straight line over the flight, one bend, two.
inline constexpr std::size_t k_track_bends = 3;
/// Every error has a column in the equations: one of each kind, and one for each axis and bend of a drift of
/// the track.
inline constexpr std::size_t k_track_columns = 4, k_error_columns = k_track_columns + 3 * k_track_bends;

/// What is known of a kind of error before the ranges are asked.
struct KnownError {
  double prior;    ///< one sigma
  double failing;  ///< less moves no anchor out of its region
  double chance;   ///< of a flight to have one
};

/// An error and the ranges that may have it: all, or those of one antenna, or of one anchor.
struct ErrorQuestion {
  std::size_t column{};
  std::optional<std::size_t> antenna{}, anchor{};
  ErrorKind kind() const { return static_cast<ErrorKind>(std::min(column, k_track_columns)); }
  /// Of a drift of the track.
  std::size_t axis() const { return (column - k_track_columns) / k_track_bends; }
  std::size_t bends() const { return (column - k_track_columns) % k_track_bends; }
  bool all() const { return !anchor && !antenna; }
  bool has(std::size_t of_anchor, std::size_t of_antenna) const {
    return (!anchor || *anchor == of_anchor) && (!antenna || *antenna == of_antenna);
  }
  const KnownError& known() const;
};

/// What is asked of a flight: all columns of all ranges first, in their order; then factors of some.
std::vector<ErrorQuestion> error_questions(const FlightRows& flight, const JointFit& fit);
/// Chance of a flight to have none of the errors.
double chance_of_no_error();

/// Index in flight.antennas.
std::size_t antenna_of(const FlightRows& flight, const JointRow& row);

/// Where the flight's halves meet.
struct FlightMiddle {
  double up_m{};  ///< of the antennas, median over the ranges
  double from_s{}, length_s{};
};
FlightMiddle middle_of(const FlightRows& flight, const JointState& state);

/// What one unit of each error adds to a range over what is expected of it: metres a unit.
using ErrorColumns = std::array<double, k_error_columns>;
/// to_anchor_m  from the antenna
ErrorColumns error_columns(const FlightMiddle& middle, double t_s, double antenna_up_m,
                           const Eigen::Vector3d& to_anchor_m);

/// What the ranges say about one systematic error, beside the anchors.
struct ErrorFinding {
  double value{};  ///< of a factor 1 + s: s; of a step or drift: metres
  double sigma{};  ///< no larger than that of the prior
  double z{};
};

/// What the flight says about one question.
struct ErrorAnswer {
  ErrorQuestion question;
  ErrorFinding found;
  std::vector<Eigen::Vector3d>
      moved{};     ///< how the anchors of the fit, which has no such error, follow it; metres a unit
  double doubt{};  ///< 0..1: how much of it the regions hold
  /// What fails: beyond doubt, and large enough to matter.
  double limit() const;
  double over_limit() const;
};

/// Gates of one anchor, each by the error of its kind that speaks most against it: "range_scale",
/// "range_step", "range_drift", "track_drift", "track_heights".
std::vector<Gate> error_gates(const FlightRows& flight, const FlightMiddle& middle,
                              const std::vector<ErrorAnswer>& answers, std::size_t anchor);

}  // namespace anchord
