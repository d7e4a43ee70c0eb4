#include "core/procedure/safety.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "core/planning/route.hpp"
#include "core/procedure/flight_engine.hpp"

namespace anchord::procedure::safety_test {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

SafetyLimits hall() {
  SafetyLimits limits;
  limits.bounds.fence = {{-30, -30}, {60, -30}, {60, 50}, {-30, 50}};
  limits.bounds.no_fly = {{{0, 0}, {30, 0}, {30, 20}, {0, 20}}};
  limits.bounds.keep_out_m = 4;
  limits.bounds.min_height_m = 1.5;
  limits.bounds.max_height_m = 20;
  limits.home_m = {-10, -10, 0};
  return limits;
}
Command go_to(double x, double y, double z) { return {Command::Kind::go_to, {x, y, z}, std::nullopt}; }
Situation well() {
  Situation now;
  now.flying = true;
  now.position_m = Vector3d(-10, -10, 5);
  now.autopilot_m = now.position_m;
  now.fix = FixClass::rtk_fixed;
  now.battery = 0.9;
  return now;
}
std::string code(const std::optional<Refused>& refused) { return refused ? refused->code : "allowed"; }

TEST(SafetyGuard, RefusesEveryTargetOutsideTheVolume) {
  const auto limits = hall();
  const Vector3d here(-10, -10, 5);
  EXPECT_EQ(code(refuse_command(limits, here, go_to(-20, 10, 5))), "allowed");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(-31, 10, 5))), "outside_fence");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(15, 10, 5))), "no_fly");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(-3, 10, 5))), "no_fly");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(-10, 10, 1))), "too_low");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(-10, 10, 21))), "too_high");
  EXPECT_EQ(code(refuse_command(limits, here, go_to(40, 30, 5))), "path_blocked")
      << "its straight way crosses the hall";
  EXPECT_EQ(code(refuse_command(limits, here, go_to(std::nan(""), 10, 5))), "not_finite");
  EXPECT_EQ(code(refuse_command(limits, std::nullopt, go_to(-20, 10, 5))), "position_unknown");
  auto wide = limits;
  wide.bounds.fence.clear();
  EXPECT_EQ(code(refuse_command(wide, here, go_to(-300, -10, 5))), "jump");
}

TEST(SafetyGuard, NeverRefusesToHoldReturnOrLand) {
  for (const auto kind : {Command::Kind::hold, Command::Kind::return_home, Command::Kind::land}) {
    EXPECT_FALSE(refuse_command(hall(), std::nullopt, {kind, {0, 0, 0}, std::nullopt}));
  }
}

TEST(SafetyGuard, JudgesATakeOff) {
  const Command up{Command::Kind::take_off, {0, 0, 4}, std::nullopt},
      high{Command::Kind::take_off, {0, 0, 40}, std::nullopt};
  EXPECT_FALSE(refuse_command(hall(), Vector3d(-10, -10, 0), up));
  EXPECT_TRUE(refuse_command(hall(), Vector3d(-10, -10, 0), high));
  EXPECT_TRUE(refuse_command(hall(), Vector3d(15, 10, 0), up)) << "inside the hall";
}

TEST(SafetyGuard, RefusesToClimbFurtherThanThePlanGoesAboveItsGround) {
  auto bounds = hall().bounds;
  bounds.min_height_m = 4;
  bounds.max_height_m = 30;
  EXPECT_FALSE(refuse_take_off(bounds, Vector3d(-10, -10, -20), 4)) << "a slope";
  auto low = bounds;
  low.max_height_m = 6;
  EXPECT_FALSE(refuse_take_off(low, Vector3d(-10, -10, -3), 4)) << "7 m up to a band that ends at 6 m";
  const auto refused = refuse_take_off(bounds, Vector3d(-10, -10, -100), 4);
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->text,
            "no take-off from here: 104 m up to the plan's height band, which ends at 30 m above its ground: "
            "is the height of the plan's origin right? "
            "It is 100 m above the aircraft");
}

TEST(SafetyWatch, HasTheReactionsOfTheDocumentation) {
  const auto limits = hall();
  EXPECT_FALSE(watch(limits, well()));
  const auto expect = [&](const Situation& now, Reaction reaction, const std::string& id) {
    const auto alarm = watch(limits, now);
    ASSERT_TRUE(alarm) << id;
    EXPECT_EQ(to_string(alarm->reaction), to_string(reaction)) << alarm->text;
    EXPECT_EQ(alarm->id, id);
    EXPECT_FALSE(alarm->text.empty());
  };
  auto now = well();
  now.battery = 0.12;
  expect(now, Reaction::land, "drone.battery");
  now.battery = 0.30;
  expect(now, Reaction::return_home, "drone.battery");
  now = well();
  now.position_m = now.autopilot_m = Vector3d(-31.5, 0, 5);
  expect(now, Reaction::hold, "fence.breach");
  now.position_m = now.autopilot_m = Vector3d(-2, 10, 5);
  expect(now, Reaction::hold, "fence.breach");
  now.position_m = now.autopilot_m = Vector3d(-10, 10, 21.5);
  expect(now, Reaction::hold, "fence.breach");
  now = well();
  now.autopilot_silent_s = 3.5;
  expect(now, Reaction::hold, "drone.link");
  now.autopilot_silent_s = 16;
  expect(now, Reaction::return_home, "drone.link");
  now = well();
  now.position_age_s = 2.5;
  expect(now, Reaction::hold, "rtk.lost");
  now.position_age_s = 11;
  expect(now, Reaction::return_home, "rtk.lost");
  now = well();
  now.since_good_fix_s = 2.5;
  expect(now, Reaction::hold, "rtk.lost");
  now.since_good_fix_s = 11;
  expect(now, Reaction::return_home, "rtk.lost");
  now = well();
  now.autopilot_m = Vector3d(-10, -6, 5);
  expect(now, Reaction::hold, "position.disagree");
  now = well();
  now.autopilot_m.reset();
  now.autopilot_m_age_s = 2.9;
  EXPECT_FALSE(watch(hall(), now));
  now.autopilot_m_age_s = 3.1;
  expect(now, Reaction::hold, "position.disagree");
}

TEST(SafetyWatch, SaysNothingOnTheGroundOrWithinTheTolerance) {
  auto now = well();
  now.position_m = now.autopilot_m = Vector3d(-30.5, 0, 5);
  EXPECT_FALSE(watch(hall(), now));
  now.battery = 0.05;
  now.flying = false;
  EXPECT_FALSE(watch(hall(), now));
}

TEST(SafetyWatch, TheReturnMarginGrowsWithTheWayHome) {
  const auto limits = hall();
  // 30 % and 100 m at 2 m/s of a battery that lasts 1200 s: 50 s more, 4.17 %.
  EXPECT_NEAR(return_margin(limits, limits.home_m + Vector3d(100, 0, 0)), 0.30 + 50.0 / 1200, 1e-12);
}

// Independent of core/planning: crossing number and the distance to every edge, sampled along the way.
double edge_m(const planning::Polygon& polygon, const Vector2d& p) {
  double out = 1e9;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Vector2d a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const double t = std::clamp((p - a).dot(b - a) / (b - a).squaredNorm(), 0.0, 1.0);
    out = std::min(out, (p - a - t * (b - a)).norm());
  }
  return out;
}
bool inside(const planning::Polygon& polygon, const Vector2d& p) {
  bool in = false;
  for (std::size_t i = 0, j = polygon.size() - 1; i < polygon.size(); j = i++) {
    const Vector2d &a = polygon[i], &b = polygon[j];
    if ((a.y() > p.y()) != (b.y() > p.y()) &&
        p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x())
      in = !in;
  }
  return in;
}
std::string broken(const SafetyLimits& limits, const Vector3d& from, const Vector3d& to) {
  constexpr double k_slack_m = 1e-6;
  const auto& b = limits.bounds;
  if (to.z() < *b.min_height_m || to.z() > *b.max_height_m) return "height";
  if (!inside(b.fence, to.head<2>()) && edge_m(b.fence, to.head<2>()) > k_slack_m) return "target";
  bool came_in = false;  // blown out of the fence it may come back, straight in and never out again
  for (int i = 0; i <= 20; ++i) {
    const Vector2d p = (from + (to - from) * i / 20.0).head<2>();
    const bool start = i == 0;  // where it is already is not the command's doing
    if (inside(b.fence, p)) {
      came_in = true;
    } else if (came_in && edge_m(b.fence, p) > k_slack_m) {
      return "fence";
    }
    for (const auto& area : b.no_fly) {
      if (!start && inside(area, p)) return "inside an area";
      const bool leaving =
          edge_m(area, from.head<2>()) < b.keep_out_m;  // outwards from a zone it is in is allowed
      if (!start && !leaving && edge_m(area, p) < b.keep_out_m - k_slack_m) return "keep-out";
    }
  }
  return "";
}

planning::Polygon random_area(std::mt19937_64& random, const Vector2d& middle, double size) {
  std::uniform_real_distribution<double> radius(0.4 * size, size), turn(0, 6.28);
  const int n = 3 + static_cast<int>(random() % 6);
  const double phase = turn(random);
  planning::Polygon out;
  for (int i = 0; i < n; ++i) {
    const double angle = phase + 6.2831853 * i / n, r = radius(random);
    out.push_back(middle + r * Vector2d(std::cos(angle), std::sin(angle)));
  }
  return out;
}

struct RandomMission {
  FlightSetup setup;
  Vector3d home{0, 0, 0};
};
RandomMission random_mission(std::mt19937_64& random) {
  std::uniform_real_distribution<double> place(-40, 40), height(0, 25), size(4, 14);
  RandomMission out;
  auto& limits = out.setup.limits;
  limits = hall();
  limits.bounds.fence = random_area(random, {0, 0}, 60);
  limits.bounds.no_fly.clear();
  for (std::uint64_t i = random() % 4; i > 0; --i) {
    limits.bounds.no_fly.push_back(random_area(random, {place(random), place(random)}, size(random)));
  }
  limits.bounds.keep_out_m = std::uniform_real_distribution<double>(0.5, 5)(random);
  for (int i = 0; i < 4; ++i) {
    out.setup.settings.waypoints.push_back(
        {{place(random), place(random), height(random)}, place(random), true, true, true, 4});
  }
  out.setup.settings.max_height_m = 30;  // wider than the band: the guard must hold by itself
  out.setup.settings.min_height_m = 0;
  out.setup.planner.grid = {3, 2, 1, 1};
  out.home = {place(random), place(random), 0};
  limits.home_m = out.home;
  return out;
}

TEST(SafetyProperty, NoCommandLeavesTheAllowedVolumeIn10000RandomMissions) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> share(0, 1);
  constexpr std::array k_triggers{
      Trigger::airborne, Trigger::arrived,   Trigger::in_range,    Trigger::sampled,      Trigger::done_here,
      Trigger::timeout,  Trigger::connected, Trigger::unreachable, Trigger::disconnected, Trigger::skip,
      Trigger::hold,     Trigger::resume,    Trigger::return_home, Trigger::no_point};
  std::size_t sent = 0, in_the_air = 0;
  for (int mission = 0; mission < 10'000; ++mission) {
    auto made = random_mission(random);
    FlightEngine engine(made.setup);
    Vector3d aircraft = made.home;
    double now = 0;
    VehicleView view;
    view.armed = view.in_air = true;
    view.battery = 0.9;
    engine.fix(now, aircraft, FixClass::rtk_fixed);
    engine.vehicle(now, view);
    ASSERT_TRUE(engine.command(now, Trigger::start, "operator"));
    for (int step = 0; step < 25; ++step) {
      for (const auto& order : engine.take_commands()) {
        if (order.kind != Command::Kind::go_to) continue;
        ++sent;
        const auto why = broken(made.setup.limits, aircraft, order.point_m);
        ASSERT_EQ(why, "") << "mission " << mission << " step " << step << ": from " << aircraft.transpose()
                           << " to " << order.point_m.transpose();
        // Wind and a coarse control: it gets there, part of the way, or drifts.
        aircraft += (order.point_m - aircraft) * (share(random) < 0.7 ? 1.0 : share(random));
      }
      now += 0.5;
      view.position_m = aircraft;
      in_the_air += engine.state().step != Step::ready;
      engine.fix(now, aircraft, FixClass::rtk_fixed);
      engine.vehicle(now, view);
      if (share(random) < 0.5) engine.range(now, {0x6a00 + static_cast<std::uint32_t>(random() % 6)}, true);
      // Anything may happen at any time, the senseless too.
      if (share(random) < 0.6) (void)engine.command(now, k_triggers[random() % k_triggers.size()], "");
      engine.tick(now, {});
    }
  }
  EXPECT_GT(sent, 10'000u) << "the test must see commands leave";
  EXPECT_GT(in_the_air, 100'000u);
}

TEST(Route, GoesRoundTheHallByLegalLegs) {
  const auto limits = hall();
  const Vector3d from(-10, 10, 5), to(40, 10, 8);
  const auto way = planning::route(limits.bounds, from, to);
  ASSERT_TRUE(way);
  ASSERT_GE(way->size(), 3u);
  EXPECT_TRUE(way->back().isApprox(to));
  double length = 0;
  Vector3d here = from;
  for (const auto& p : *way) {
    EXPECT_EQ(broken(limits, here, p), "");
    length += (p - here).norm();
    here = p;
  }
  // Taut string round the corners at 4 m: about 50 m + 2 x 5.5 m; a few turning points are not on it.
  EXPECT_LT(length, 68);
}

TEST(Route, SaysWhenThereIsNoWay) {
  auto limits = hall();
  EXPECT_FALSE(planning::route(limits.bounds, {-10, 10, 5}, {15, 10, 5}));
  limits.bounds.no_fly.push_back(
      {{35, -40}, {36, -40}, {36, 60}, {35, 60}});  // a wall across the whole fence
  EXPECT_FALSE(planning::route(limits.bounds, {-10, 10, 5}, {50, 10, 5}));
}

}  // namespace
}  // namespace anchord::procedure::safety_test
