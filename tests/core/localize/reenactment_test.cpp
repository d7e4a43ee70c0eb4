// Fig 8.10 and 8.11 of the dissertation in simulation: the path of Fig 8.8, one position after the other, the
// anchor solved after each from ranges as received and from corrected ones.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <random>

#include "core/localize/solver.hpp"
#include "core/planning/next_point.hpp"

namespace anchord::reenactment_test {
namespace {

constexpr int k_iterations = 20, k_ranges_each = 10, k_seeds = 200;
const Eigen::Vector3d k_anchor(-1.2, 0, 0);

/// Section 8.5: from (3, 0) in steps of 0.48 m before a wall at x = -0.5, always to the lowest GDOP.
std::vector<Eigen::Vector3d> path() {
  planning::NextPointInput input;
  input.visited = {{3, 0, 0}};
  input.anchors = {{"a", {{k_anchor, 1}}, {0}}};
  input.bounds.walls = {{{-0.5, -100}, {-0.5, 100}, 0, 0}};
  planning::NextPointOptions options;
  options.dims = 2;
  options.grid.step_m = 0.48;
  while (static_cast<int>(input.visited.size()) < k_iterations) {
    const auto decision = planning::next_point(input, options).value();
    input.anchors[0].measured_at.push_back(input.visited.size());
    input.visited.push_back(decision.candidates[decision.chosen.value()].point_m);
  }
  return input.visited;
}

struct Errors {
  double bias_m, variance_m2;  // as received and after mitigation; tables 6.5 and 6.6, section 7.2.3
};
constexpr Errors k_los{0.103, k_variance_los_m2}, k_nlos{0.301, k_variance_nlos_m2};

double error_m(const std::vector<Observation>& rows) {
  SolverOptions options;
  options.dims = Dims::two;
  // The first guess is 0.5 m off, as a turn and a range give it (8.4.1).
  const auto fit = solve_anchor_gauss_newton(rows, k_anchor + Eigen::Vector3d(0.4, 0.3, 0), options);
  return fit ? (fit.value().position_m - k_anchor).norm() : 10.0;
}

struct Convergence {
  std::array<double, k_iterations> raw_m{}, corrected_m{};  ///< median over the seeds, after each iteration
};

Convergence fly(const Errors& errors) {
  const auto places = path();
  std::vector<std::array<double, k_seeds>> raw(k_iterations), corrected(k_iterations);
  for (std::size_t seed = 0; seed < k_seeds; ++seed) {
    std::mt19937_64 random(seed + 1);
    std::normal_distribution<double> noise(0, 1);
    std::vector<Observation> as_received, mitigated;
    for (std::size_t k = 0; k < places.size(); ++k) {
      const Eigen::Vector3d seen =
          places[k] + std::sqrt(k_variance_rtk_m2) * Eigen::Vector3d(noise(random), noise(random), 0);
      for (int i = 0; i < k_ranges_each; ++i) {
        Observation o;
        o.tag_m = seen;
        o.sigma_m = std::sqrt(errors.variance_m2);
        o.tag_covariance_m2 = Eigen::Vector3d(k_variance_rtk_m2, k_variance_rtk_m2, 0).asDiagonal();
        o.distance_m = (places[k] - k_anchor).norm() + o.sigma_m * noise(random);
        mitigated.push_back(o);
        o.distance_m += errors.bias_m;
        as_received.push_back(o);
      }
      raw[k][seed] = error_m(as_received);
      corrected[k][seed] = error_m(mitigated);
    }
  }
  Convergence course;
  const auto median = [](std::array<double, k_seeds>& values) {
    std::ranges::nth_element(values, values.begin() + k_seeds / 2);
    return values[k_seeds / 2];
  };
  for (std::size_t k = 0; k < k_iterations; ++k) {
    course.raw_m[k] = median(raw[k]);
    course.corrected_m[k] = median(corrected[k]);
    std::printf("iteration %2zu  raw %.3f m  corrected %.3f m\n", k + 1, course.raw_m[k],
                course.corrected_m[k]);
  }
  return course;
}

TEST(Reenactment, OfFigure810EndsWithinTwoCentimetresInLineOfSight) {
  const Convergence course = fly(k_los);
  EXPECT_LE(course.corrected_m.back(), 0.02);
  EXPECT_GT(course.raw_m.back(), course.corrected_m.back());
}

TEST(Reenactment, OfFigure811EndsWithinNineCentimetresWithoutLineOfSight) {
  const Convergence course = fly(k_nlos);
  EXPECT_LE(course.corrected_m.back(), 0.09);
  EXPECT_GT(course.raw_m.back(), course.corrected_m.back());
  EXPECT_LT(course.corrected_m.back(), 0.5 * course.corrected_m[4]) << "iterations must pay";
}

}  // namespace
}  // namespace anchord::reenactment_test
