#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// May this position be believed? Only `ok` may ever be accepted without a person.
enum class Verdict : std::uint8_t { ok, weak_geometry, ambiguous, too_few, diverged };

/// One place an anchor may be.
struct Hypothesis {
  Enu position{};                                          ///< ENU of the site origin, or local metres
  std::optional<Wgs84> wgs84{};                            ///< absent in a local frame
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};  ///< ENU or local axes
  double rms_residual_m{};
  double probability{1.0};
};

/// Position of one anchor with all that is needed to judge it.
struct Estimate {
  NetworkId anchor{};
  UtcTime time{};  ///< of the newest measurement used
  Verdict verdict{Verdict::too_few};
  std::string reason;                  ///< in words, with the numbers; empty when ok
  std::optional<Hypothesis> best{};    ///< absent when too few
  std::optional<Hypothesis> mirror{};  ///< the twin that fits as well
  double h95_m{};                      ///< radius holding 95 % horizontally (major semi-axis)
  double v95_m{};
  std::optional<double> gdop{};        ///< sqrt(trace (M^T M)^-1), the usual number
  std::optional<double> gdop_trace{};  ///< eq 8.5 as printed: the trace without the root
  std::size_t n_used{};
  std::map<std::string, std::size_t> refused;  ///< reason -> count
  std::optional<double> bias_m{};
  std::optional<double> bias_sigma_m{};
  std::optional<double> lag_s{};
  std::optional<double> lag_sigma_s{};
};

}  // namespace anchord
