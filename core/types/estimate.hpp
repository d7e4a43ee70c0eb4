#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// May this position be believed? Only `ok` may ever be accepted without a person.
enum class Verdict : std::uint8_t { ok, weak_geometry, ambiguous, too_few, diverged };
inline constexpr auto k_verdict_words = enum_table<Verdict>({{"ok", Verdict::ok},
                                                             {"weak_geometry", Verdict::weak_geometry},
                                                             {"ambiguous", Verdict::ambiguous},
                                                             {"too_few", Verdict::too_few},
                                                             {"diverged", Verdict::diverged}});

/// One acceptance test of an estimate: named, with its number and its limit.
struct Gate {
  std::string name;               ///< redundancy, geometry, side, chi_square, halves, flights, bias, prior
  std::optional<double> value{};  ///< absent: could not be measured, and `why` says what was missing
  double limit{};
  bool passed{false};
  std::string why;  ///< in words, with the numbers
};

/// What one range said in the end.
struct RangeResidual {
  UtcTime time{};
  NetworkId tag{};
  std::uint8_t antenna{0};
  Eigen::Vector3d tag_m{0, 0, 0};  ///< antenna, ENU or local, lag applied
  double distance_m{};             ///< as received
  double corrected_m{};            ///< less the bias, curve, unit delay and what a model took off
  double sigma_m{};                ///< of the range with the place of its tag, before the robust weight
  double residual_m{};             ///< corrected - geometric
  double standardised{};           ///< residual over its sigma and redundancy
  double weight{};                 ///< 0..1; 0: rejected
  std::optional<double> p_los{};   ///< after the fit, where a model gave one before
};

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
  std::optional<Hypothesis> mirror{};  ///< the mirror solution that fits as well
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
  /// The largest part of its error budget and what would help most, in words; empty where none was made.
  std::string largest_part{};
  std::vector<Gate> gates{};  ///< in the order they were asked; empty in flight, where nothing is accepted

  /// May be accepted without a person: verdict ok and every gate passed. Nothing else ever is.
  bool acceptable() const;
};

inline bool Estimate::acceptable() const {
  return verdict == Verdict::ok && best && !gates.empty() &&
         std::all_of(gates.begin(), gates.end(), [](const Gate& gate) { return gate.passed; });
}

}  // namespace anchord
