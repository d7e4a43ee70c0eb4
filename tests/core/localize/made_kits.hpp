#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <optional>
#include <random>
#include <vector>

#include "core/localize/flight_options.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::testing {

using Random = std::mt19937_64;

/// What is true of one kit: the same in all of its flights, but for what wanders between them. Drawn as the
/// solver's priors have it, and by an antenna pattern that it has no unknown for.
struct MadeKit {
  double bias_m{}, curve_m{}, lag_s{}, lever_up_m{};
  double unit_delay_m{};  ///< sigma of the delays of single anchors
  /// Range error over the direction in the body, the five harmonics of second degree, each of this sigma and
  /// together of no mean over the sphere: what imitates a bias where only few directions are flown.
  Eigen::Matrix<double, 5, 1> pattern_m{Eigen::Matrix<double, 5, 1>::Zero()};
};
MadeKit draw_kit(double bias_m, Random& random);

/// How ranges are spoilt beyond what every flight has. One side: by a delay that scatters; late side: by 0.5
/// m, alike on all of them; walls: those through each wall and through the roof by an amount of its own, 0.1
/// to 0.8 m, or by nothing.
enum class Spoilage : std::uint8_t {
  none,
  scattered,
  bursts,
  one_sided,
  one_anchor,
  far_off,
  late_side,
  walls
};
const char* word(Spoilage spoilage);

/// One flight of a kit round a building of its own, 60 to 120 s; walls, heights, radii and anchors are drawn.
struct KitFlight {
  FlightData flight;
  std::map<NetworkId, Eigen::Vector3d> truth_m;
  /// Starts at the truth: the search for one is tested elsewhere, and takes most of the time.
  FlightOptions options() const;
};
KitFlight fly(const MadeKit& kit, const std::string& name, Random& random, Spoilage spoilage = Spoilage::none,
              double share = 0);

}  // namespace anchord::testing
