// What flights say about the bias of their kit: no cliff, a doubt that stays, and intervals that hold.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

#include "core/localize/flight_solver.hpp"
#include "core/localize/kit_prior.hpp"
#include "tests/core/localize/made_kits.hpp"

namespace anchord::kit_bias_test {
namespace {

using testing::KitFlight;
using testing::MadeKit;
using testing::Random;

/// A flight that saw a bias of `seen_m` with `sigma_m`, and nothing else.
ProfileFactor told(double seen_m, double sigma_m) {
  ProfileFactor factor;
  factor.information(k_shared_bias, k_shared_bias) = 1.0 / (sigma_m * sigma_m);
  factor.information_mean[k_shared_bias] = seen_m / (sigma_m * sigma_m);
  return factor;
}

BiasGate gate_of(double seen_m, double sigma_m, std::size_t flights = 1) {
  return bias_gate(std::vector<ProfileFactor>(flights, told(seen_m, sigma_m)), FlightOptions{});
}

// A prior of 0.28 m once became one of 0.025 m where sigma came below 0.1 m, and one of 1 m where z passed 3:
// a millimetre more moved the answer by a tenth of a metre.
TEST(KitBias, HasNoCliff) {
  constexpr double step_m = 0.001;
  for (const double sigma_m : {0.03, 0.06, 0.09, 0.15, 0.3}) {
    for (double seen_m = 0; seen_m < 1.0; seen_m += step_m) {
      const BiasGate here = gate_of(seen_m, sigma_m), next = gate_of(seen_m + step_m, sigma_m);
      EXPECT_LT(std::abs(next.bias_m - here.bias_m), 6 * step_m) << seen_m << ' ' << sigma_m;
      EXPECT_LT(std::abs(next.sigma_m - here.sigma_m), 3 * step_m) << seen_m << ' ' << sigma_m;
      EXPECT_LT(std::abs(std::log(next.prior_sigma_m / here.prior_sigma_m)), 0.1) << seen_m << ' ' << sigma_m;
    }
  }
  for (const double seen_m : {0.0, 0.05, 0.1, 0.2, 0.4}) {
    for (double sigma_m = 0.03; sigma_m < 0.3; sigma_m += step_m) {
      const BiasGate here = gate_of(seen_m, sigma_m), next = gate_of(seen_m, sigma_m + step_m);
      EXPECT_LT(std::abs(next.bias_m - here.bias_m), 15 * step_m) << seen_m << ' ' << sigma_m;
      EXPECT_LT(std::abs(next.sigma_m - here.sigma_m), 8 * step_m) << seen_m << ' ' << sigma_m;
    }
  }
}

// Each knows its bias by 0.06 m; an antenna pattern may imitate as much in all of them.
TEST(KitBias, KeepsTheDoubtHoweverManyFlightsSpeak) {
  for (const std::size_t flights : {1U, 3U, 10U, 100U}) {
    EXPECT_GE(gate_of(0.25, 0.06, flights).sigma_m, 0.05) << flights;
    EXPECT_GE(gate_of(0.7, 0.06, flights).sigma_m, 0.05) << flights;
  }
  EXPECT_LT(gate_of(0.25, 0.06, 10).sigma_m, gate_of(0.25, 0.06, 1).sigma_m);
}

TEST(KitBias, IsNoneWhereNothingStandsOutAndWhatWasSeenWhereItDoes) {
  EXPECT_LT(gate_of(0.05, 0.06).bias_m, 0.02);
  EXPECT_TRUE(gate_of(0.0, 0.06).known);
  EXPECT_NEAR(gate_of(0.5, 0.06).bias_m, 0.5, 0.01);
  EXPECT_TRUE(gate_of(0.5, 0.06).known);
  const BiasGate nothing = gate_of(0.0, 5.0);
  EXPECT_FALSE(nothing.known);
  EXPECT_GT(nothing.sigma_m, 0.2);
}

/// Flights of one kit, each in a place of its own, with anchors of its own.
struct Flown {
  std::vector<KitFlight> flights;
  FlightOptions options;
};
Flown fly_kit(const MadeKit& kit, int n, Random& random) {
  Flown flown;
  for (int i = 0; i < n; ++i) {
    KitFlight one = testing::fly(kit, "flight " + std::to_string(i), random);
    const auto renamed = [&](NetworkId id) {
      return NetworkId{id.value + 0x100U * static_cast<std::uint32_t>(i)};
    };
    std::map<NetworkId, Eigen::Vector3d> truth_m;
    one.flight.anchor_names.clear();
    for (const auto& [id, at_m] : one.truth_m) {
      truth_m[renamed(id)] = flown.options.starts[renamed(id)] = at_m;
      one.flight.anchor_names[renamed(id)] = to_string(renamed(id));
    }
    for (Range& range : one.flight.ranges) range.anchor = renamed(range.anchor);
    one.truth_m = truth_m;
    flown.flights.push_back(std::move(one));
  }
  return flown;
}

TEST(KitBias, IsHeldByTheIntervalOfTheProfileAndItsAnchorsByTheirRegions) {
  int kits = 0, held = 0, anchors = 0, inside = 0;
  for (const double bias_m : {0.0, 0.1, 0.25, 0.7}) {
    int held_of_bias = 0;
    for (int n = 1; n <= 10; ++n) {
      Random random(static_cast<std::uint64_t>(10 * n) + static_cast<std::uint64_t>(100 * bias_m));
      const MadeKit kit = testing::draw_kit(bias_m, random);
      const Flown flown = fly_kit(kit, n, random);
      std::vector<const FlightData*> flights;
      for (const KitFlight& one : flown.flights) flights.push_back(&one.flight);
      KitProfile profile;
      const auto solved = solve_flights(flights, flown.options, &profile);
      ASSERT_TRUE(solved.has_value());
      const BiasGate gate = bias_gate(profile.factors, flown.options);
      ++kits;
      held_of_bias += std::abs(gate.bias_m - bias_m) < 1.96 * gate.sigma_m ? 1 : 0;
      for (std::size_t i = 0; i < flown.flights.size(); ++i) {
        for (const AnchorSolution& anchor : solved.value()[i].anchors) {
          if (!anchor.estimate.best) continue;
          const Eigen::Vector3d off =
              anchor.estimate.best->position.m - flown.flights[i].truth_m.at(anchor.estimate.anchor);
          ++anchors;
          inside += off.dot(anchor.estimate.best->covariance_m2.inverse() * off) < 7.815 ? 1 : 0;
        }
      }
    }
    std::printf("bias %.2f m: the profile's 95 %% interval holds it in %d of 10 kits\n", bias_m,
                held_of_bias);
    EXPECT_GE(held_of_bias, 8) << bias_m;
    held += held_of_bias;
  }
  std::printf("%d of %d kits, %d of %d anchors inside\n", held, kits, inside, anchors);
  EXPECT_GE(held, 37);  // 93 % of 40
  EXPECT_GE(inside, (93 * anchors) / 100);
}

}  // namespace
}  // namespace anchord::kit_bias_test
