// Which side of the wall: a flight before one facade leaves two places, one in the building, one in the open;
// a flight at one height leaves one above and one below.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/localize/flight_solver.hpp"
#include "core/localize/turn.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::side_test {
namespace {

const NetworkId k_id{0x6001};
const Eigen::Vector3d k_inside(3, 4, 5);  // 12 m behind the plane of the flight; the building begins at y = 0
constexpr double k_plane_y_m = -8;

/// Two minutes up and down along the facade, in its plane but for the RTK's noise, the heading all round.
FlightData facade() {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1);
  FlightData flight;
  flight.mission.frame = TrackFrame::local;
  for (int i = 0; i < 1200; ++i) {
    const double t_s = 0.1 * i;
    Fix fix;
    fix.time = UtcTime::from_seconds(t_s);
    fix.frame = TrackFrame::local;
    fix.fix = FixClass::rtk_fixed;
    const Eigen::Vector3d at(12 * std::sin(0.11 * t_s), k_plane_y_m, 7 + 5 * std::sin(0.29 * t_s));
    const double heading = 0.4 * t_s;  // clockwise from north
    fix.local_m = at + 0.01 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    fix.enu_from_body =
        Eigen::Quaterniond(Eigen::AngleAxisd(0.5 * std::numbers::pi - heading, Eigen::Vector3d::UnitZ()));
    flight.fixes.push_back(fix);
    const Eigen::Vector3d way = k_inside - at;
    Range range;
    range.time = fix.time;
    range.tag = NetworkId{0x6e01};
    range.anchor = k_id;
    range.distance_m = way.norm() + 0.05 * noise(random);
    range.rss_dbm = -60 - 20 * std::log10(way.norm()) +
                    10 * turn_profile(heading - std::atan2(way.x(), way.y())) + 2 * noise(random);
    flight.ranges.push_back(range);
  }
  return flight;
}

Eigen::Vector3d mirror_m() { return {k_inside.x(), 2 * k_plane_y_m - k_inside.y(), k_inside.z()}; }

Estimate solved(const FlightOptions& options) {
  return solve_flight(facade(), options).value().anchors.front().estimate;
}

void expect_inside_alone(const FlightOptions& options) {
  const Estimate e = solved(options);
  ASSERT_TRUE(e.best);
  EXPECT_LT((e.best->position.m - k_inside).norm(), 0.5) << e.best->position.m.transpose();
  EXPECT_EQ(e.verdict, Verdict::ok) << e.reason;
  EXPECT_FALSE(e.mirror);
}

TEST(OneFacade, LeavesBothPlacesBeforeAnyPrior) {
  const Estimate e = solved({});
  ASSERT_TRUE(e.best && e.mirror);
  EXPECT_EQ(e.verdict, Verdict::ambiguous);
  EXPECT_FALSE(e.acceptable());
  const bool first_inside = (e.best->position.m - k_inside).norm() < (e.best->position.m - mirror_m()).norm();
  const auto& in = first_inside ? *e.best : *e.mirror;
  const auto& out = first_inside ? *e.mirror : *e.best;
  EXPECT_LT((in.position.m - k_inside).norm(), 0.5);
  EXPECT_LT((out.position.m - mirror_m()).norm(), 0.5);
  EXPECT_NEAR(in.probability + out.probability, 1.0, 1e-9);
  EXPECT_LT(std::max(in.probability, out.probability), 0.99);
}

TEST(OneFacade, IsDecidedByTheBearingOfTheTurn) {
  FlightOptions options;
  const Eigen::Vector3d turned_at(0, k_plane_y_m, 7);
  // North-east of there, 30 degrees wrong.
  options.priors[k_id].bearing = {turned_at, std::atan2(3.0, 12.0) + 0.5, 0.35};
  expect_inside_alone(options);
}

TEST(OneFacade, IsDecidedByTheOutlineOfTheBuilding) {
  FlightOptions options;
  options.outline_m = {{-15, 0}, {15, 0}, {15, 20}, {-15, 20}};
  expect_inside_alone(options);
}

TEST(OneFacade, IsDecidedByTheLevelsOfAnAircraftThatTurns) {
  FlightOptions options;
  options.level_sigma_db = 3;
  expect_inside_alone(options);
}

TEST(OneFacade, FollowsAPriorThatIsWrongAsFarAsItsSigmaSays) {
  FlightOptions options;
  options.priors[k_id].bearing = {{0, k_plane_y_m, 7}, std::numbers::pi, 0.35};
  const Estimate e = solved(options);
  ASSERT_TRUE(e.best);
  EXPECT_LT((e.best->position.m - mirror_m()).norm(), 0.5);
}

// A facade cannot tell by height, a flight at one height can.
TEST(OneHeight, IsDecidedByTheHeightSearch) {
  FlightData flight = facade();
  for (auto& fix : flight.fixes) std::swap(fix.local_m.y(), fix.local_m.z());
  const Eigen::Vector3d anchor(k_inside.x(), k_inside.z(), k_inside.y());
  const auto before = solve_flight(flight).value().anchors.front().estimate;
  ASSERT_TRUE(before.mirror);
  EXPECT_EQ(before.verdict, Verdict::ambiguous);
  FlightOptions options;
  options.priors[k_id].height = {5.5, 2.0};
  const auto after = solve_flight(flight, options).value().anchors.front().estimate;
  ASSERT_TRUE(after.best);
  EXPECT_LT((after.best->position.m - anchor).norm(), 0.5) << after.best->position.m.transpose();
  EXPECT_EQ(after.verdict, Verdict::ok) << after.reason;
  EXPECT_FALSE(after.mirror);
}

// A wall or the edge of a roof makes peaks of the level that no antenna makes: simulated height searches were
// 6 m off, and took the anchor with them by up to 5.6 m.
TEST(AllRound, TheRangesOverruleAHeightSearchThatIsMetresOff) {
  testing::MadeFlight made;
  made.duration_s = 40;
  made.noise_m = 0.15;
  const FlightData flight = testing::make_flight(made);
  const auto high_m = [&](const FlightOptions& options) {
    const auto solution = solve_flight(flight, options);
    const auto& first = solution.value().anchors.front().estimate;
    return first.best->position.m.z();
  };
  const NetworkId first = solve_flight(flight).value().anchors.front().estimate.anchor;
  FlightOptions options;
  options.priors[first].height = {made.anchors.front().z() + 6, 0.54};
  EXPECT_NEAR(high_m(options), high_m({}), 0.1);
}

}  // namespace
}  // namespace anchord::side_test
