#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "core/base/ids.hpp"
#include "core/localize/contradiction.hpp"

namespace anchord {

/// A place known by other means, beside the answer; metres in one frame.
struct CheckPoint {
  NetworkId anchor{};
  KnownPlace surveyed, solved;
  bool plane{false};  ///< one of the two has no height of its own
};

/// Solved minus surveyed, and how likely so much is by chance.
struct Misclosure {
  NetworkId anchor{};
  Eigen::Vector3d delta_m{0, 0, 0};
  bool plane{false};
  double chi2{}, limit{}, p_value{};
  bool agrees{};
};

/// What all of them are off alike: a wrong base, or another datum.
struct CommonShift {
  Eigen::Vector3d shift_m{0, 0, 0};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
  bool plane{false};
  double chi2{}, limit{}, p_value{};
  bool significant{};
};

struct CheckReport {
  std::vector<Misclosure> points;      ///< in the order given
  std::optional<CommonShift> shift{};  ///< of two and more
};

/// Misclosures, each against both covariances, and their weighted mean as a shift common to all. The errors
/// of one flight are largely the same at all its anchors, so that mean is held against the mean of the
/// covariances, not against a smaller one. Limits at GateLimits::probability. points   finite; positive
/// definite sums of covariances; others are left out
CheckReport check_against(std::span<const CheckPoint> points, const GateLimits& limits = {});

}  // namespace anchord
