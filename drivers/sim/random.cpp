#include "drivers/sim/random.hpp"

#include <cmath>
#include <numbers>

namespace anchord::sim {

double Random::uniform() { return static_cast<double>(engine_() >> 11) * 0x1.0p-53; }

double Random::normal() {
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));  // 1 - u: never log(0)
  return radius * std::cos(2.0 * std::numbers::pi * uniform());
}

Eigen::Vector3d Random::normal3() {
  const double x = normal(), y = normal(), z = normal();  // named: the order of arguments is not fixed
  return {x, y, z};
}

double Random::exponential(double mean) { return -mean * std::log(1.0 - uniform()); }

}  // namespace anchord::sim
