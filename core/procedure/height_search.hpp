#pragma once

#include <optional>
#include <span>

#include "core/base/result.hpp"

namespace anchord::procedure {

struct HeightSample {
  double height_m{};
  double rss_dbm{};
};
struct HeightGuess {
  double height_m{};
  double sigma_m{};        ///< at least 0.2 m, the accuracy of Fig 8.5b
  double significance{};   ///< of the curvature, in its sigmas: below about 4 the peak may be noise
  bool at_edge{};          ///< the best RSS lay at an end of the search: the anchor may be beyond it
  bool too_narrow{false};  ///< sharper than antennas make it from there: a reflection, a gap in a wall
};

/// Height of the anchor from RSS over height (8.3.6): RSS is highest at the anchor's own height. A parabola
/// through all samples; where it has no peak inside the search, the best sample and a sigma of half the
/// search.
///
/// distance_m  to the anchor, metres; absent: no peak is too narrow. Antennas bend the level by the
///             elevation alone, so by the less a metre the further away they are.
/// errors      too_few_observations (fewer than 5), weak_geometry (less than 0.5 m of height),
/// invalid_argument
Result<HeightGuess> height_from_search(std::span<const HeightSample> samples,
                                       std::optional<double> distance_m = std::nullopt);

}  // namespace anchord::procedure
