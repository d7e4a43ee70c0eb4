// What the report shows per iteration (Fig 8.10 and 8.11 of the dissertation).
#include "core/localize/convergence.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/core/localize/flight_support.hpp"

namespace anchord::convergence_test {
namespace {

using testing::MadeFlight;
using testing::make_flight;

constexpr double k_bias_m = 0.3;

/// A flight whose ranges are all 0.3 m long; a model knows it, and believes those to the first anchor
/// blocked. Its ranges come newest first, as some logs have them.
FlightData corrected_flight(const MadeFlight& made) {
  FlightData flight = make_flight(made);
  std::ranges::reverse(flight.ranges);
  for (Range& range : flight.ranges) {
    flight.received_m.push_back(range.distance_m);
    range.distance_m -= k_bias_m;
    RangeErrorModel model;
    model.p_los = range.anchor == NetworkId{0x6000} ? 0.02 : 0.98;
    model.nlos_sigma_m = 0.05;
    model.nlos_tail_m = 0.01;
    flight.error_models.emplace_back(model);
  }
  return flight;
}

TEST(Convergence, TellsOfEachIterationTheErrorOfItsRangesAndHowTheyWereJudged) {
  MadeFlight made;
  made.bias_m = k_bias_m;
  made.noise_m = 0.02;
  FlightOptions options;
  options.fixed_bias_m = 0.0;
  const auto course = convergence_of(corrected_flight(made), options, 5);
  ASSERT_TRUE(course);
  ASSERT_EQ(course.value().size(), made.anchors.size());
  for (std::size_t i = 0; i < made.anchors.size(); ++i) {
    const auto& steps = course.value().at(NetworkId{static_cast<std::uint32_t>(0x6000 + i)});
    ASSERT_EQ(steps.size(), 5U);
    std::size_t n_judged = 0;
    for (const auto& step : steps) {
      ASSERT_TRUE(step.middle);
      const double truth_m = (step.middle->tag_m - made.anchors[i]).norm();
      EXPECT_NEAR(step.middle->distance_m - truth_m, k_bias_m, 0.03);
      EXPECT_NEAR(step.middle->corrected_m - truth_m, 0.0, 0.03);
      EXPECT_GT(i == 0 ? step.n_nlos : step.n_los, 3 * (i == 0 ? step.n_los : step.n_nlos));
      n_judged += step.n_los + step.n_nlos;
    }
    EXPECT_EQ(n_judged, steps.back().n_ranges);
    const double corrected_m = (*steps.back().corrected_m - made.anchors[i]).norm();
    EXPECT_LT(corrected_m, 0.02);
    EXPECT_GT((*steps.back().raw_m - made.anchors[i]).norm(), 0.03) << "solved from ranges as received";
  }
}

TEST(Convergence, LeavesOutIterationsThatBringNothingNew) {
  FlightData flight = make_flight({});
  flight.ranges.resize(30);
  const auto course = convergence_of(flight, {}, 50);
  ASSERT_TRUE(course);
  for (const auto& [id, steps] : course.value()) {
    for (std::size_t i = 1; i < steps.size(); ++i) EXPECT_GT(steps[i].share, steps[i - 1].share);
    EXPECT_LE(steps.size(), 30U);
  }
}

}  // namespace
}  // namespace anchord::convergence_test
