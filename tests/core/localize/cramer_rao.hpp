#pragma once

#include <cstdint>

namespace anchord::testing {

/// What many flights of the dissertation's error model came to: LOS 2401 mm^2, NLOS 54550 mm^2, RTK 400 mm^2,
/// 8 anchors in a building of 30 x 20 m, 200 tag positions round it.
struct CramerRao {
  double rmse_over_bound{};  ///< root of summed squared errors over root of summed traces of the bound
  double coverage{};         ///< of the claimed 95 % region
  double rmse_m{};
};

enum class Ranges : std::uint8_t {
  labelled,    ///< a fifth is blocked without bias, and every range's variance is known
  unlabelled,  ///< a fifth is blocked and 0.3 to 1 m long; known is only how often that happens
  unmodelled,  ///< the same, and nothing is known: the redescending loss alone
};

/// The bound is that of a solver that knows which ranges are blocked, by how much on average, and each
/// variance. Deterministic in seed.
CramerRao cramer_rao(Ranges ranges, int flights, std::uint64_t seed);

}  // namespace anchord::testing
