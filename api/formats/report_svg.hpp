#pragma once

#include <limits>
#include <string>
#include <vector>

#include "api/formats/report.hpp"

/// The drawings of the report as inline SVG. Colours are the tokens of its style sheet.
namespace anchord::report {

/// "−0.12": fixed decimals, a true minus, an en dash where there is no number.
std::string fixed(double value, int decimals);

/// Distance of a position to a reference; in the plane where the reference has no height (NaN).
double distance_m(const Eigen::Vector3d& at, const Eigen::Vector3d& reference_m);
/// Outline, tracks, anchors with 95 % ellipses (one magnification, named), mirrors, scale and north.
std::string map(const Report& report);
/// Residuals of one anchor over time; rejected ones as crosses.
std::string residuals(const std::vector<const std::vector<RangeResidual>*>& flights);
/// Error raw and corrected, and the claimed 95 % radius, per iteration. `truth`: against it, else against the
/// end.
std::string course(const std::vector<ConvergenceStep>& steps, const Eigen::Vector3d& reference);

/// Error of an iteration's middle range against `reference`, metres; NaN where it had no range.
struct RangeErrors {
  double raw_m{std::numeric_limits<double>::quiet_NaN()};
  double corrected_m{std::numeric_limits<double>::quiet_NaN()};
};
RangeErrors range_errors(const ConvergenceStep& step, const Eigen::Vector3d& reference);
/// What a model predicted of most ranges of the iteration: "L" (line of sight), "N" (not line of sight), "–"
/// (no prediction).
std::string predicted_class(const ConvergenceStep& step);
/// Error of the ranges raw and corrected, and their predicted class, per iteration.
std::string range_course(const std::vector<ConvergenceStep>& steps, const Eigen::Vector3d& reference);

}  // namespace anchord::report
