#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>

namespace anchord::sim {

/// Random numbers of one simulation: the same seed gives the same numbers with every standard library, which
/// std::normal_distribution does not promise. Not thread-safe; one per simulation.
class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  /// In [0, 1), 53 random bits.
  double uniform();
  /// Mean 0, standard deviation 1 (Box-Muller).
  double normal();
  Eigen::Vector3d normal3();
  /// Exponential with the given mean.
  double exponential(double mean);
  bool chance(double probability) { return uniform() < probability; }

 private:
  std::mt19937_64 engine_;
};

}  // namespace anchord::sim
