// What a flight's turns and height searches tell: kept on the globe, priors in any frame, and what decides
// between an anchor and its mirror solution while the flight is in the air.
#include "core/procedure/flight_priors.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/localize/live_flight.hpp"

namespace anchord::procedure::flight_priors_test {
namespace {

constexpr NetworkId k_prior_anchor{0x6a21}, k_other{0x6a22};
constexpr double k_plane_y_m = -8;
const Eigen::Vector3d k_inside(3, 4, 5), k_turned_at(0, k_plane_y_m, 7);

TEST(FlightPriors, MeanTheSameInAnotherFrame) {
  const EnuFrame plan({51.0231, 3.7131, 55.5}), answers({51.0271, 3.7131, 60.0});
  std::map<NetworkId, Priors> found;
  found[k_prior_anchor].bearing = Bearing{1.2, 0.4, 0.8};
  found[k_prior_anchor].turned_at_m = k_turned_at;
  found[k_prior_anchor].height = HeightGuess{5, 0.3, 9, false};
  found[k_prior_anchor].climbed_at_m = k_turned_at;
  found[k_other].height = HeightGuess{9, 1.5, 0, true};
  found[k_other].climbed_at_m = k_turned_at;
  const auto kept = flight_priors(found, plan);
  found[k_other].height = HeightGuess{9, 1.0, 2, false};
  EXPECT_EQ(flight_priors(found, plan).size(), 1u) << "a peak of the noise";
  found[k_other].height = HeightGuess{9, 1.0, 20, false, true};
  EXPECT_EQ(flight_priors(found, plan).size(), 1u) << "a peak of a reflection";
  ASSERT_EQ(kept.size(), 1u) << "the best level of the other lay at the end of its search";
  const auto here = priors_in(kept, plan), there = priors_in(kept, answers);
  EXPECT_LT((here.at(k_prior_anchor).bearing->tag_m - k_turned_at).norm(), 1e-6);
  EXPECT_DOUBLE_EQ(here.at(k_prior_anchor).bearing->bearing_rad, 1.2);
  EXPECT_DOUBLE_EQ(here.at(k_prior_anchor).bearing->sigma_rad, 0.4);
  EXPECT_NEAR(here.at(k_prior_anchor).height->up_m, 5, 1e-6);
  EXPECT_GT(here.at(k_prior_anchor).height->sigma_m, 0.3);
  // 0.004 degrees north of there is 445 m; the earth falls away by 16 mm meanwhile.
  EXPECT_NEAR(there.at(k_prior_anchor).bearing->tag_m.y(), k_plane_y_m - 445.1, 0.2);
  EXPECT_NEAR(there.at(k_prior_anchor).height->up_m, 5 - 4.5, 0.03);
}

TEST(FlightPriors, OfALaterTurnReplaceTheFormer) {
  FlightPriors before, after;
  before[k_prior_anchor].bearing = FlightPrior::Bearing{{}, 1, 0.4};
  before[k_prior_anchor].height = FlightPrior::Height{{}, 1};
  after[k_prior_anchor].bearing = FlightPrior::Bearing{{}, 2, 0.4};
  const auto both = merged(before, after);
  EXPECT_EQ(both.at(k_prior_anchor).bearing->bearing_rad, 2);
  EXPECT_TRUE(both.at(k_prior_anchor).height);
}

/// A live flight in one upright plane before the facade: an anchor in the building and its mirror solution in
/// the open fit alike.
LiveFlight facade() {
  std::mt19937_64 random(5);
  std::normal_distribution<double> noise(0, 1);
  Mission mission;
  mission.frame = TrackFrame::local;
  LiveFlight live(mission);
  for (int i = 0; i < 900; ++i) {
    const double t_s = 0.1 * i;
    const Eigen::Vector3d at(12 * std::sin(0.11 * t_s), k_plane_y_m, 7 + 5 * std::sin(0.29 * t_s));
    Fix fix;
    fix.time = UtcTime::from_seconds(t_s);
    fix.frame = TrackFrame::local;
    fix.fix = FixClass::rtk_fixed;
    fix.local_m = at + 0.01 * Eigen::Vector3d(noise(random), noise(random), noise(random));
    live.add(fix);
    Range range;
    range.time = fix.time;
    range.tag = NetworkId{0x6e01};
    range.anchor = k_prior_anchor;
    range.distance_m = (k_inside - at).norm() + 0.05 * noise(random);
    live.add(range);
  }
  return live;
}

AnchorPriors seen_at(double bearing_rad, double sigma_rad) {
  AnchorPriors priors;
  priors.bearing = {k_turned_at, bearing_rad, sigma_rad};
  return priors;
}
double bearing_of(const Eigen::Vector3d& place_m) {
  const Eigen::Vector3d way = place_m - k_turned_at;
  return std::atan2(way.x(), way.y());
}

TEST(LiveMirrors, StandBothUntilTheTurnHasTold) {
  auto live = facade();
  live.finish();
  const auto before = live.estimates().front();
  ASSERT_TRUE(before.best && before.mirror) << before.reason;
  EXPECT_EQ(before.verdict, Verdict::ambiguous);
}

TEST(LiveMirrors, AreDecidedByTheTurnWhicheverCameFirst) {
  const Eigen::Vector3d mirror(k_inside.x(), 2 * k_plane_y_m - k_inside.y(), k_inside.z());
  for (const auto& wanted : {k_inside, mirror}) {
    auto live = facade();
    live.set_priors({{k_prior_anchor, seen_at(bearing_of(wanted) + 0.3, 0.35)}});
    live.finish();
    const auto after = live.estimates().front();
    ASSERT_TRUE(after.best);
    EXPECT_FALSE(after.mirror);
    EXPECT_EQ(after.verdict, Verdict::ok) << after.reason;
    EXPECT_LT((after.best->position.m - wanted).norm(), 0.5) << after.best->position.m.transpose();
  }
}

TEST(LiveMirrors, StandBothWhenTheBearingIsWeak) {
  auto live = facade();
  live.set_priors({{k_prior_anchor, seen_at(bearing_of(k_inside), 100 * std::numbers::pi / 180)}});
  live.finish();
  const auto after = live.estimates().front();
  ASSERT_TRUE(after.best && after.mirror) << "180 degrees are 1.8 sigma: four to one, not beyond 99 %";
  EXPECT_LT((after.best->position.m - k_inside).norm(), 0.5);
  EXPECT_GT(after.best->probability, 0.6);
  EXPECT_LT(after.best->probability, 0.99);
  EXPECT_NEAR(after.best->probability + after.mirror->probability, 1, 1e-9);
}

}  // namespace
}  // namespace anchord::procedure::flight_priors_test
