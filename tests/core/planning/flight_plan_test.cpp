#include "core/planning/flight_plan.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "core/planning/design.hpp"

namespace anchord::planning::flight_plan_test {
namespace {

using Eigen::Vector3d;

const Polygon k_hall{{0, 0}, {30, 0}, {30, 20}, {0, 20}};
const Polygon k_l_outline{{0, 0}, {40, 0}, {40, 15}, {15, 15}, {15, 40}, {0, 40}};

TEST(Ring, KeepsItsDistanceRoundEveryCorner) {
  for (const auto& outline : {k_hall, k_l_outline, Polygon(k_l_outline.rbegin(), k_l_outline.rend())}) {
    const auto ring = ring_around(outline, 4, 2);
    ASSERT_GT(ring.size(), 40U);
    for (const auto& p : ring) {
      EXPECT_FALSE(contains(outline, p));
      EXPECT_NEAR(distance_to_edge_m(outline, p), 4, 1e-9);
    }
  }
}

void expect_legal(const FlightPlan& plan, const Polygon& outline, double keep_out_m) {
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    const auto &a = plan.waypoints[i].point_m, &b = plan.waypoints[(i + 1) % plan.waypoints.size()].point_m;
    EXPECT_GE(distance_to_edge_m(outline, a.head<2>()), keep_out_m - 1e-6);
    for (double t = 0; t <= 1; t += 0.02) {  // the way too, but for the arc of a corner
      const Eigen::Vector2d p = ((1 - t) * a + t * b).head<2>();
      EXPECT_FALSE(contains(outline, p)) << "leg " << i;
      EXPECT_GE(distance_to_edge_m(outline, p), keep_out_m - 1e-6) << "leg " << i;
    }
  }
}

TEST(FlightPlan, FliesRoundAHallAtItsKeepOutDistance) {
  const auto plan = plan_flight({k_hall, 6, {}, {}}, {}).value();
  EXPECT_GE(plan.n_measure, 8U);
  EXPECT_LE(plan.n_measure, 60U);
  expect_legal(plan, k_hall, 4);
  double lowest = 1e9, highest = 0;
  for (const auto& w : plan.waypoints) {
    lowest = std::min(lowest, w.point_m.z());
    highest = std::max(highest, w.point_m.z());
  }
  EXPECT_GT(highest - lowest, 4.5);  // a flat flight cannot tell heights
  EXPECT_LT(plan.rms_m, 0.2);
}

TEST(FlightPlan, GoesRoundTheNotchOfAnL) {
  expect_legal(plan_flight({k_l_outline, 9, {}, {}}, {}).value(), k_l_outline, 4);
}

// A lawn-mower ring of as many points at one height, evenly spread, is what people fly by hand.
TEST(FlightPlan, PredictsLessErrorThanAnEvenRingOfAsManyPoints) {
  FlightPlanOptions options;
  const auto plan = plan_flight({k_hall, 6, {}, {}}, options).value();
  Design ring(plan.assumed_anchors_m, options, {k_hall, 6});
  const auto points = ring_around(k_hall, 4, 1);
  for (std::size_t i = 0; i < plan.n_measure; ++i) {
    const auto& p = points[i * points.size() / plan.n_measure];
    ring.add({p.x(), p.y(), 3});
  }
  EXPECT_LT(plan.rms_m, 0.8 * std::sqrt(ring.mean_square_m2()));
}

TEST(FlightPlan, StopsByGainAndSaysSo) {
  FlightPlanOptions eager, thrifty;
  eager.min_gain = 0.005;
  thrifty.min_gain = 0.10;
  const auto many = plan_flight({k_hall, 6, {}, {}}, eager).value();
  const auto few = plan_flight({k_hall, 6, {}, {}}, thrifty).value();
  EXPECT_LT(few.n_measure, many.n_measure);
  EXPECT_LT(many.rms_m, few.rms_m);
  EXPECT_THAT(few.reason, testing::HasSubstr("by only"));
}

TEST(FlightPlan, StaysInsideTheFenceAndOutOfNoFly) {
  FlightPlanInput input{k_hall,
                        6,
                        {{{10, -30}, {20, -30}, {20, -6.5}, {10, -6.5}}},
                        {{-8, -40}, {60, -40}, {60, 60}, {-8, 60}}};
  const auto plan = plan_flight(input, {}).value();
  for (const auto& w : plan.waypoints) {
    EXPECT_TRUE(contains(input.fence, w.point_m.head<2>()));
    EXPECT_GE(distance_to_edge_m(input.no_fly[0], w.point_m.head<2>()), 3.8 - 1e-6);
  }
}

// A block of 60 x 60 m round a court of 30 x 30 m, with a gate of 6 m: too narrow at 4 m of clearance.
TEST(FlightPlan, IsFlownRoundTheBlockAndNotInACourtThatNoPermittedPathLeadsTo) {
  const Polygon block{{0, 0},   {27, 0},  {27, 15}, {15, 15}, {15, 45}, {45, 45},
                      {45, 15}, {33, 15}, {33, 0},  {60, 0},  {60, 60}, {0, 60}};
  const auto inside = [](const Vector3d& p) { return p.x() > 0 && p.x() < 60 && p.y() > 0 && p.y() < 60; };
  const auto plan = plan_flight({block, 6, {}, {}}, {}).value();
  EXPECT_GT(plan.n_unreachable, 0U);
  EXPECT_NE(plan.reason.find("no permitted path"), std::string::npos) << plan.reason;
  for (const auto& w : plan.waypoints) EXPECT_FALSE(inside(w.point_m));
  // A gate that is wide enough: the court is measured from, too.
  Polygon wide = block;
  wide[1].x() = wide[2].x() = 22;
  wide[7].x() = wide[8].x() = 38;
  const auto both = plan_flight({wide, 6, {}, {}}, {}).value();
  EXPECT_EQ(both.n_unreachable, 0U);
  EXPECT_TRUE(std::ranges::any_of(both.waypoints, [&](const auto& w) { return inside(w.point_m); }));
  // A fence that leaves the court alone: it is what is flown.
  const Polygon court{{15, 15}, {45, 15}, {45, 45}, {15, 45}};
  const auto within = plan_flight({block, 6, {}, court}, {}).value();
  for (const auto& w : within.waypoints) EXPECT_TRUE(inside(w.point_m));
}

TEST(FlightPlan, NamesWhatMakesItImpossible) {
  EXPECT_EQ(plan_flight({{{0, 0}, {1, 0}}, 6, {}, {}}, {}).error().code, Errc::invalid_argument);
  EXPECT_EQ(plan_flight({{{0, 0}, {10, 0}, {20, 0}}, 6, {}, {}}, {}).error().code, Errc::invalid_argument);
  EXPECT_EQ(plan_flight({k_hall, 6, {}, {{5, 5}, {10, 5}, {10, 10}}}, {}).error().code, Errc::not_found);
  FlightPlanOptions options;
  options.keep_out_m = -1;
  EXPECT_EQ(plan_flight({k_hall, 6, {}, {}}, options).error().code, Errc::invalid_argument);
}

TEST(FlightPlan, IsTheSameEveryTime) {
  const auto a = plan_flight({k_l_outline, 9, {}, {}}, {}).value(),
             b = plan_flight({k_l_outline, 9, {}, {}}, {}).value();
  ASSERT_EQ(a.waypoints.size(), b.waypoints.size());
  for (std::size_t i = 0; i < a.waypoints.size(); ++i)
    EXPECT_EQ(a.waypoints[i].point_m, b.waypoints[i].point_m);
}

TEST(Design, AddingAndRemovingAPointLeavesNoTrace) {
  const std::vector<Vector3d> anchors{{5, 5, 2}, {20, 10, 2}};
  FlightPlanOptions options;
  for (const auto rule : {Rule::a_optimal, Rule::d_optimal}) {
    options.rule = rule;
    Design design(anchors, options);
    for (const auto& p : {Vector3d(-4, 0, 2), Vector3d(35, 0, 10), Vector3d(10, 25, 5), Vector3d(0, 25, 8)})
      design.add(p);
    const double before = design.value(), expected = design.value_with({15, -5, 4});
    design.add({15, -5, 4});
    EXPECT_NEAR(design.value(), expected, 1e-9 * std::abs(expected));
    design.remove({15, -5, 4});
    EXPECT_NEAR(design.value() / before, 1, 1e-6);
  }
}

// Walls met at a slant make ranges late, a roof more than a wall; what that does to the answer is the
// least-squares answer to "ranges" that are the slants, all at once.
TEST(Design, KnowsHowFarSlantedSightsShiftTheAnswer) {
  const std::vector<Vector3d> anchors{{15, 4, 3}};
  const FlightPlanOptions options;
  Design design(anchors, options, {k_hall, 6});
  Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
  information.diagonal().head<3>().setConstant(1 / (options.prior_sigma_m * options.prior_sigma_m));
  information(3, 3) = 1 / (options.bias_sigma_m * options.bias_sigma_m);
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  for (const auto& p : {Vector3d(-5, -5, 2), Vector3d(20, -6, 7), Vector3d(36, 3, 4), Vector3d(-7, 12, 3),
                        Vector3d(12, 27, 9), Vector3d(3, -9, 5)}) {
    const auto s = design.sights(p)[0];
    information += s.row * s.row.transpose() / s.variance_m2;
    right += s.row * s.slant / s.variance_m2;
    design.add(p);
  }
  const Eigen::Matrix4d covariance = information.inverse();
  const Eigen::Vector3d shift = options.wall_excess_m * (covariance * right).head<3>();
  const double expected = covariance.topLeftCorner(3, 3).trace() + shift.squaredNorm();
  EXPECT_NEAR(design.mean_square_m2(), expected, 1e-9 * expected);
}

TEST(Design, CountsWallsByTheirSlantAndTheRoofTwice) {
  const std::vector<Vector3d> anchors{{15, 4, 3}};
  const FlightPlanOptions options;
  Design design(anchors, options, {k_hall, 6});
  // At right angles through one wall: 1. At 45 degrees: 1.414. In over the 6 m wall means in through the
  // roof: 20 m of way, 15 m of it down, so 20/15 of two walls.
  EXPECT_NEAR(design.sights({15, -5, 3})[0].slant, 1, 1e-9);
  EXPECT_NEAR(design.sights({6, -5, 3})[0].slant, std::numbers::sqrt2, 1e-9);
  EXPECT_NEAR(design.sights({15, 4 - std::sqrt(175.0), 18})[0].slant, 2 * 20 / 15.0, 1e-9);
}

// Points of a star: pockets that a ring cannot be walked round, and corners sharper than a right angle.
TEST(FlightPlan, FindsItsWayRoundAStar) {
  Polygon star;
  for (int i = 0; i < 16; ++i) {
    const double angle = i * 3.14159265358979 / 8, radius = i % 2 == 1 ? 20 : 8;
    star.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  const FlightPlanOptions options;
  const auto plan = plan_flight({star, 6, {}, {}}, options);
  ASSERT_TRUE(plan) << plan.error().message;
  expect_legal(plan.value(), star, options.keep_out_m);
}

// Drawn from a survey: a corner every 26 cm is no reason for a ring of thousands.
TEST(FlightPlan, FliesRoundAFinelyDrawnCurve) {
  Polygon round;
  for (int i = 0; i < 360; ++i)
    round.emplace_back(15 * std::cos(i * 3.14159265358979 / 180), 15 * std::sin(i * 3.14159265358979 / 180));
  const FlightPlanOptions options;
  const auto plan = plan_flight({round, 6, {}, {}}, options);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_LT(plan.value().n_candidates, 1000u);
  EXPECT_EQ(plan.value().reason.find("left out"), std::string::npos) << plan.value().reason;
  expect_legal(plan.value(), round, options.keep_out_m);
}

// 800 x 500 m with 60 m of range: what lies deep inside cannot be ranged from outside; the rest is planned
// for.
TEST(FlightPlan, LeavesOutWhatIsOutOfRangeFromEverywhere) {
  const Polygon huge{{0, 0}, {800, 0}, {800, 500}, {0, 500}};
  FlightPlanOptions options;
  const auto plan = plan_flight({huge, 6, {}, {}}, options);
  ASSERT_TRUE(plan) << plan.error().message;
  EXPECT_GT(plan.value().n_out_of_range, 0u);
  EXPECT_GT(plan.value().assumed_anchors_m.size(), 0u);
  EXPECT_GT(plan.value().n_measure, 20u);
  EXPECT_NE(plan.value().reason.find("out of range"), std::string::npos);
}

}  // namespace
}  // namespace anchord::planning::flight_plan_test
