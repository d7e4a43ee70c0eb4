#include "core/planning/next_point.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "core/planning/information.hpp"

namespace anchord::planning::next_point_test {
namespace {

using Eigen::Vector3d;

/// Section 8.5: drone at (3, 0), anchor at (-1.2, 0), step 0.48, wall at x = -0.5.
struct Fig88 {
  NextPointInput input;
  NextPointOptions options;
  std::vector<double> traces;

  Fig88() {
    input.visited = {{3, 0, 0}};
    input.anchors = {{"a", {{{-1.2, 0, 0}, 1}}, {0}}};
    input.bounds.walls = {{{-0.5, -100}, {-0.5, 100}, 0, 0}};
    options.dims = 2;
    options.grid.step_m = 0.48;
  }
  Vector3d step() {
    const auto decision = next_point(input, options).value();
    const auto& c = decision.candidates[decision.chosen.value()];
    input.anchors[0].measured_at.push_back(input.visited.size());
    input.visited.push_back(c.point_m);
    traces.push_back(c.value);
    return c.point_m;
  }
};

TEST(NextPoint, OfTheDissertationsExampleIsAtMinusFortyEight) {
  Fig88 flight;
  const auto p = flight.step();
  EXPECT_NEAR(p.x(), 2.52, 1e-12);
  EXPECT_NEAR(p.y(), -0.48, 1e-12);
}

// Fig 8.8: six diagonal steps, then along the wall; the column nearest to it is 3 - 7 * 0.48 = -0.36.
TEST(NextPoint, FollowsTheWallFromIterationSeven) {
  Fig88 flight;
  for (int i = 1; i <= 14; ++i) {
    const auto p = flight.step();
    EXPECT_NEAR(p.x(), i < 7 ? 3 - 0.48 * i : -0.36, 1e-9) << i;
    EXPECT_NEAR(p.y(), -0.48 * i, 1e-9) << i;
  }
}

TEST(NextPoint, KeepsItsDistanceFromTheWall) {
  Fig88 flight;
  flight.input.bounds.walls[0].keep_out_m = 0.2;
  for (int i = 1; i <= 14; ++i) {
    const auto p = flight.step();
    EXPECT_NEAR(p.x(), i < 7 ? 3 - 0.48 * i : 0.12, 1e-9) << i;
  }
}

// Fig 8.9. The first value is 2 / sin^2 of the angle between the two sights.
TEST(NextPoint, LowersTheGdopInEveryIteration) {
  Fig88 flight;
  for (int i = 0; i < 14; ++i) flight.step();
  EXPECT_NEAR(flight.traces[0], 2 / std::pow(std::sin(std::atan(0.48 / 3.72)), 2), 1e-9);
  for (std::size_t i = 1; i < flight.traces.size(); ++i) EXPECT_LT(flight.traces[i], flight.traces[i - 1]);
}

TEST(NextPoint, TakesTheNextBestWhenTheBestWasUnreachable) {
  Fig88 flight;
  flight.input.unreachable = {{2.52, -0.48, 0}};
  const auto p = flight.step();
  EXPECT_NEAR(p.y(), 0.48, 1e-12);  // the mirrored one is as good
  EXPECT_NEAR(p.x(), 2.52, 1e-12);
}

TEST(NextPoint, ShowsTheValueOfRefusedCandidatesAndWhy) {
  Fig88 flight;
  const auto decision = next_point(flight.input, flight.options).value();
  ASSERT_EQ(decision.candidates.size(), 9U);
  EXPECT_EQ(decision.candidates[4].refused, Refusal::visited);
  EXPECT_TRUE(std::isinf(decision.value_before));
  EXPECT_THAT(decision.reason, testing::HasSubstr("1 visited"));
  EXPECT_THAT(decision.reason, testing::HasSubstr("trace 122.1"));
}

TEST(NextPoint, SaysSoWhenThereIsNowhereToGo) {
  Fig88 flight;
  flight.input.bounds.fence = {{2.9, -0.1}, {3.1, -0.1}, {3.1, 0.1}, {2.9, 0.1}};
  const auto decision = next_point(flight.input, flight.options).value();
  EXPECT_FALSE(decision.chosen);
  EXPECT_THAT(decision.reason, testing::HasSubstr("no point left to fly to"));
  EXPECT_THAT(decision.reason, testing::HasSubstr("8 outside_fence"));
}

TEST(NextPoint, RefusesPointsBeyondTheRangeOfEveryAnchor) {
  Fig88 flight;
  flight.options.max_range_m = 4.0;
  const auto decision = next_point(flight.input, flight.options).value();
  const auto& chosen = decision.candidates[decision.chosen.value()];
  EXPECT_LT((chosen.point_m - Vector3d(-1.2, 0, 0)).norm(), 4.0);
  EXPECT_EQ(decision.candidates[0].point_m.x(), 2.52);
  EXPECT_EQ(decision.candidates[2].refused, Refusal::over_range);
}

TEST(NextPoint, ChoosesASpreadWhileEveryCandidateIsSingularInSpace) {
  NextPointInput input;
  input.visited = {{5, 0, 2}};
  input.anchors = {{"a", {{{0, 0, 2}, 1}}, {0}}};
  NextPointOptions options;
  options.grid.reach_up = 1;
  const auto decision = next_point(input, options).value();
  ASSERT_TRUE(decision.chosen);
  const auto& c = decision.candidates[*decision.chosen];
  EXPECT_TRUE(std::isinf(c.value));
  EXPECT_NE(c.point_m.y(), 0.0);
  EXPECT_THAT(decision.reason, testing::HasSubstr("singular"));
}

TEST(NextPoint, WorstHelpsTheAnchorThatIsWorstOff) {
  NextPointInput input;
  // "done" is surrounded; "poor" has been seen from nearly one direction only.
  input.visited = {{10, 0, 0}, {0, 10, 0}, {-10, 0, 0}, {0, -10, 0}, {0.5, -10, 0}};
  input.current = Vector3d{0, -10, 0};
  input.anchors = {{"done", {{{0, 0, 0}, 1}}, {0, 1, 2, 3}}, {"poor", {{{0, 30, 0}, 1}}, {3, 4}}};
  NextPointOptions options;
  options.dims = 2;
  options.grid.step_m = 4;
  const auto decision = next_point(input, options).value();
  const auto& poor = decision.candidates.of_anchor[1];
  for (std::size_t i = 0; i < decision.candidates.size(); ++i) {
    if (!decision.candidates[i].refused) {
      EXPECT_LE(poor[decision.chosen.value()], poor[i] * (1 + 1e-9));
    }
  }
}

// The other side of a facade: with the mirror as likely as the place itself, both count.
TEST(NextPoint, AveragesOverMirrorPlaces) {
  Fig88 flight;
  flight.input.visited.push_back({2.52, -0.48, 0});
  flight.input.anchors[0].measured_at.push_back(1);
  auto mirrored = flight.input;
  mirrored.anchors[0].places = {{{-1.2, 0, 0}, 0.5}, {{5, 2, 0}, 0.5}};
  auto other = flight.input;
  other.anchors[0].places = {{{5, 2, 0}, 1}};
  const auto a = next_point(flight.input, flight.options).value();
  const auto b = next_point(other, flight.options).value();
  const auto both = next_point(mirrored, flight.options).value();
  for (std::size_t i = 0; i < both.candidates.size(); ++i) {
    const double expected = 0.5 * (a.candidates[i].value + b.candidates[i].value);
    if (std::isfinite(expected)) {
      EXPECT_NEAR(both.candidates[i].value / expected, 1.0, 1e-9);
    }
  }
}

TEST(NextPoint, PrefersANearerPointWhenFlightTimeCounts) {
  NextPointInput input;
  input.visited = {{10, 0, 0}, {10, 2, 0}};
  input.anchors = {{"a", {{{0, 0, 0}, 1}}, {0, 1}}};
  NextPointOptions options;
  options.dims = 2;
  options.rule = Rule::a_optimal;
  options.grid = {1.0, 1.0, 12, 0};
  const auto far = next_point(input, options).value();
  options.flight_time_cost = true;
  options.dwell_s = 0.5;
  const auto near = next_point(input, options).value();
  const Vector3d from = input.visited.back();
  EXPECT_LT((near.candidates[*near.chosen].point_m - from).norm(),
            (far.candidates[*far.chosen].point_m - from).norm());
}

// Behind a wall a range is worth (0.2336^2 + 0.02^2) / (0.049^2 + 0.02^2) = 19.6 times less.
TEST(NextPoint, GoesRoundAWallToALineOfSight) {
  NextPointInput input;
  input.visited = {{0, -5, 0}, {0.5, -5, 0}};
  input.anchors = {{"a", {{{0, 0, 0}, 1}}, {0, 1}}};
  input.bounds.walls = {{{-2, -3}, {-2, 3}, 0, 1.0}};  // shadows the west
  NextPointOptions options;
  options.dims = 2;
  options.rule = Rule::a_optimal;
  options.grid = {4.0, 4.0, 1, 0};
  const auto decision = next_point(input, options).value();
  EXPECT_GT(decision.candidates[*decision.chosen].point_m.x(), 0.5);
}

/// A site with everything in it: past points, areas, walls of both kinds, limits, an anchor on a candidate.
struct Crowded {
  NextPointInput input;
  NextPointOptions options;

  explicit Crowded(int seed) {
    std::mt19937_64 random(static_cast<std::uint64_t>(seed));
    std::uniform_real_distribution<double> at(-6, 6), up(0, 6);
    const auto point = [&] { return Vector3d{at(random), at(random), up(random)}; };
    for (int i = 0; i < 40; ++i) input.visited.push_back(point());
    for (int i = 0; i < 5; ++i) input.unreachable.push_back(point());
    input.current = Vector3d{0.25, -0.5, 3};
    input.anchors = {{"a", {{{1.25, 0.5, 3.5}, 0.7}, {point(), 0.3}}, {0, 1, 2, 3, 4}},
                     {"b", {{point(), 1}}, {5, 6, 7, 8}}};
    input.bounds.fence = {{-4.2, -4.1}, {4.4, -3.9}, {4.1, 4.3}, {0.1, 2.2}, {-4.3, 4.2}};
    input.bounds.no_fly = {{{1.1, -2.9}, {2.3, -2.8}, {2.2, -1.4}}};
    input.bounds.keep_out_m = 0.4;
    input.bounds.walls = {{{-3, 1}, {-1, 1.5}, 0.3, 0.6}, {{2.7, 0}, {2.8, 2}, 0, 0}};
    input.bounds.min_height_m = 1.2;
    input.bounds.max_height_m = 4.6;
    input.walls = std::make_shared<std::vector<BuiltWall>>(
        std::vector<BuiltWall>{{{-2, -2}, {2, -2.2}, 0, 3.1, 0.2, WallMaterial::concrete},
                               {{0.7, -3}, {0.8, 3}, 2, 5, 0.1, WallMaterial::metal}});
    options.grid = {0.5, 0.5, 9, 5};
    options.dims = seed % 2 ? 3 : 2;
    options.max_range_m = 4.5;
  }

  std::optional<Refusal> refused(const Vector3d& p) const {
    const auto near = [&](const Vector3d& other) {
      return std::abs(p.x() - other.x()) < 0.25 && std::abs(p.y() - other.y()) < 0.25 &&
             std::abs(p.z() - other.z()) < 0.25;
    };
    if (std::ranges::any_of(input.unreachable, near)) return Refusal::unreachable;
    if (near(*input.current) || std::ranges::any_of(input.visited, near)) return Refusal::visited;
    if (const auto why = refuse_point(input.bounds, p)) return why;
    if (const auto why = refuse_path(input.bounds, *input.current, p)) return why;
    bool over = true;
    for (const auto& anchor : input.anchors) {
      for (const auto& place : anchor.places) {
        const Vector3d d = p - place.position_m;
        if (d.head(options.dims).norm() <= 1e-6) return Refusal::on_anchor;
        over = over && d.norm() > *options.max_range_m;
      }
    }
    if (over) return Refusal::over_range;
    return std::nullopt;
  }

  /// 1 where nothing gets through: more than 43 dB.
  double p_nlos(const Vector3d& p) const {
    double sum = 0;
    for (const auto& anchor : input.anchors) {
      const Vector3d& place = anchor.places.front().position_m;
      double loss_db = 0;
      for (const auto& hit : hits_between(*input.walls, p, place)) loss_db += hit.loss_db;
      const double drawn = p_nlos_through(input.bounds, p, place);
      sum += loss_db > 43 ? 1 : 1 - (1 - drawn) * std::pow(10, -loss_db / 10);
    }
    return sum / 2;
  }
};

// Each candidate by itself, rule after rule, as 8.3.9 and 8.4.3 state them.
TEST(NextPoint, RefusesAndExpectsOfAWholeGridWhatItDoesOfEachCandidateAlone) {
  std::map<Refusal, int> met;
  for (int seed = 1; seed <= 4; ++seed) {
    const Crowded site(seed);
    const auto decision = next_point(site.input, site.options).value();
    ASSERT_EQ(decision.candidates.size(), 19u * 19 * 11);
    for (const auto& c : decision.candidates) {
      EXPECT_EQ(c.refused, site.refused(c.point_m)) << c.point_m.transpose() << " of " << seed;
      EXPECT_NEAR(c.p_nlos, site.p_nlos(c.point_m), 1e-12) << c.point_m.transpose() << " of " << seed;
      if (c.refused) ++met[*c.refused];
    }
  }
  EXPECT_EQ(met.size(), k_refusal_words.size()) << "every reason is met";
}

// A point half-way between two candidates is of neither.
TEST(NextPoint, VisitsACellFromLessThanHalfAStepAway) {
  Fig88 flight;
  flight.input.current = Vector3d{3, 0, 0};
  flight.options.grid = {1.0, 1.0, 2, 0};
  flight.input.visited.push_back({3 + 1.5, 0.49, 0});
  const auto decision = next_point(flight.input, flight.options).value();
  for (const auto& c : decision.candidates)
    EXPECT_EQ(c.refused == Refusal::visited, c.point_m == Vector3d(3, 0, 0)) << c.point_m.transpose();
  flight.input.visited.back().x() = 3 + 1.51;
  const auto other = next_point(flight.input, flight.options).value();
  int n = 0;
  for (const auto& c : other.candidates) n += c.refused == Refusal::visited;
  EXPECT_EQ(n, 2);
}

TEST(NextPoint, RefusesInputThatMakesNoSense) {
  Fig88 flight;
  auto input = flight.input;
  input.anchors[0].measured_at = {7};
  EXPECT_EQ(next_point(input, flight.options).error().code, Errc::invalid_argument);
  input = flight.input;
  input.anchors.clear();
  EXPECT_EQ(next_point(input, flight.options).error().code, Errc::invalid_argument);
  auto options = flight.options;
  options.grid.step_m = 0;
  EXPECT_EQ(next_point(flight.input, options).error().code, Errc::invalid_argument);
  options = flight.options;
  options.grid.reach = 400, options.grid.reach_up = 400;
  EXPECT_EQ(next_point(flight.input, options).error().code, Errc::invalid_argument);
}

/// Rebuilds the information matrix of position (and bias) and inverts it.
Eigen::MatrixXd brute_covariance(const Vector3d& place, const std::vector<Vector3d>& points,
                                 const std::vector<double>& p_nlos, const NextPointOptions& o) {
  const int d = o.dims, n = d + (o.bias_column ? 1 : 0);
  Eigen::MatrixXd info = Eigen::MatrixXd::Identity(n, n) / (o.prior_sigma_m * o.prior_sigma_m);
  if (o.bias_column) info(d, d) = 1 / (o.bias_sigma_m * o.bias_sigma_m);
  for (std::size_t i = 0; i < points.size(); ++i) {
    Eigen::VectorXd h(n);
    const Vector3d full = points[i] - place;
    h.head(d) = full.head(d).normalized();
    if (o.bias_column) h[d] = 1;
    const double rtk = o.position_sigma_m * o.position_sigma_m;
    const double w = (1 - p_nlos[i]) / (o.los_sigma_m * o.los_sigma_m + rtk) +
                     p_nlos[i] / (o.nlos_sigma_m * o.nlos_sigma_m + rtk);
    info += w * h * h.transpose();
  }
  return info.inverse().topLeftCorner(d, d);
}

TEST(Information, AgreesWithRebuildingAndInvertingInTwoThousandRandomCases) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> at(-20, 20), p(0, 1);
  std::uniform_int_distribution<int> how_many(4, 30);
  for (int i = 0; i < 2000; ++i) {
    NextPointOptions options;
    options.dims = i % 2 ? 2 : 3;
    options.bias_column = i % 4 < 2;
    options.rule = i % 8 < 4 ? Rule::a_optimal : Rule::d_optimal;
    options.prior_sigma_m = 10;
    const Vector3d place{at(random), at(random), at(random)};
    std::vector<Vector3d> points;
    std::vector<double> p_nlos;
    Information base(place, std::nullopt, options);
    for (int k = how_many(random); k > 0; --k) {
      points.push_back({at(random), at(random), at(random)});
      p_nlos.push_back(p(random));
      base.add(points.back(), p_nlos.back());
    }
    const Vector3d candidate{at(random), at(random), at(random)};
    points.push_back(candidate);
    p_nlos.push_back(0.3);
    const auto cov = brute_covariance(place, points, p_nlos, options);
    const double expected = options.rule == Rule::a_optimal ? cov.trace() : std::log(cov.determinant());
    EXPECT_NEAR(base.with(candidate, 0.3) / expected, 1.0, 2e-8) << i;  // pinned axes add 1e-12 m^2
  }
}

}  // namespace
}  // namespace anchord::planning::next_point_test
