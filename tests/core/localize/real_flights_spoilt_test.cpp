// Real flights (../shared/data) spoilt in ways that happen: whatever is still accepted must hold the truth.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <random>

#include "tests/core/localize/real_flights.hpp"
#include "tests/paths.hpp"

namespace anchord::real_flights_spoilt_test {
namespace {

using testing::AnchorError;
using testing::FlightSet;

struct Spoilt {
  const char* how;
  std::function<void(FlightData&)> spoil;
  bool with_profile{false};  ///< once more, with what the kit's other flights say
};

double since_start_s(const FlightData& flight, const Range& range) {
  return seconds_between(flight.ranges.front().time, range.time);
}

void keep_part(FlightData& flight, double from, double to) {
  const double end_s = since_start_s(flight, flight.ranges.back());
  const FlightData whole = flight;
  std::erase_if(flight.ranges, [&](const Range& r) {
    const double share = since_start_s(whole, r) / end_s;
    return share < from || share > to;
  });
}

void shift(FlightData& flight, double by_s) {
  for (auto& range : flight.ranges) range.time.ns += static_cast<std::int64_t>(by_s * 1e9);
}

void add_bias(FlightData& flight, double by_m) {
  for (auto& range : flight.ranges) range.distance_m += by_m;
}

void block_some(FlightData& flight) {
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> uniform(0, 1);
  for (auto& range : flight.ranges)
    if (uniform(random) < 0.3) range.distance_m += 0.3 + 1.7 * uniform(random);
}

/// All ranges to the first anchor go through a wall: 1 m and an exponential delay on top.
void block_first_anchor(FlightData& flight) {
  const NetworkId first = flight.anchor_names.begin()->first;
  std::mt19937_64 random(4);
  std::exponential_distribution<double> late_m(1 / 0.3);
  for (auto& range : flight.ranges)
    if (range.anchor == first) range.distance_m += 1.0 + late_m(random);
}

/// The same, 0.5 m, for every second anchor.
void block_every_second_anchor(FlightData& flight) {
  std::mt19937_64 random(4);
  std::exponential_distribution<double> late_m(1 / 0.3);
  std::map<NetworkId, bool> blocked;
  for (const auto& [id, name] : flight.anchor_names) blocked[id] = blocked.size() % 2 == 0;
  for (auto& range : flight.ranges)
    if (blocked[range.anchor]) range.distance_m += 0.5 + late_m(random);
}

/// Which half of the places, east or west (or by x), a range was taken in.
std::function<bool(const Range&)> in_the_east(const FlightData& flight) {
  std::vector<std::pair<std::int64_t, double>> track;
  std::vector<double> sorted;
  for (const auto& fix : flight.fixes) {
    const double x = fix.frame == TrackFrame::local ? fix.local_m.x() : fix.position.lon_deg;
    track.emplace_back(fix.time.ns, x);
    sorted.push_back(x);
  }
  std::ranges::sort(track);
  std::ranges::sort(sorted);
  const double middle = sorted[sorted.size() / 2];
  return [track = std::move(track), middle](const Range& r) {
    auto at = std::ranges::lower_bound(track, std::pair{r.time.ns, -1e9});
    if (at == track.end()) --at;
    return at->second > middle;
  };
}

/// Ranges of the half of the places that lies west (or at small x).
void keep_one_side(FlightData& flight) { std::erase_if(flight.ranges, in_the_east(flight)); }

/// An obstacle in the east: 0.5 m, alike on all ranges from there.
void delay_one_side(FlightData& flight) {
  const auto east = in_the_east(flight);
  for (auto& range : flight.ranges)
    if (east(range)) range.distance_m += 0.5;
}

/// The tag is 0.3 m from where it is declared. Where the track is the tag's own there is no arm.
void declare_arm_wrongly(FlightData& flight) {
  if (flight.mission.point == TrackPoint::tag_antenna) return;
  for (auto& tag : flight.mission.tags) tag.lever_arm_body_m += Eigen::Vector3d(0.18, -0.24, 0);
}

void exchange_two_anchors_half_way(FlightData& flight) {
  const NetworkId a = flight.anchor_names.begin()->first, b = std::next(flight.anchor_names.begin())->first;
  const double half_s = 0.5 * since_start_s(flight, flight.ranges.back());
  const UtcTime start = flight.ranges.front().time;
  for (auto& range : flight.ranges) {
    if (seconds_between(start, range.time) < half_s) continue;
    if (range.anchor == a)
      range.anchor = b;
    else if (range.anchor == b)
      range.anchor = a;
  }
}

void keep_every_20th(FlightData& flight) {
  std::vector<Range> few;
  for (std::size_t i = 0; i < flight.ranges.size(); i += 20) few.push_back(flight.ranges[i]);
  flight.ranges = std::move(few);
}

TEST(SpoiltRealFlights, AreNeverAcceptedBesideTheTruth) {
  if (!std::filesystem::exists(ANCHORD_SHARED_DATA)) {
    std::printf("SKIPPED: no real flights, looked for %s\n", ANCHORD_SHARED_DATA);
    GTEST_SKIP() << "no real flights, looked for " << ANCHORD_SHARED_DATA;
  }
  const std::vector<Spoilt> ways{
      {"bias -0.3 m", [](FlightData& f) { add_bias(f, -0.3); }},
      {"bias +2 m", [](FlightData& f) { add_bias(f, 2.0); }, true},
      {"track 0.5 s early", [](FlightData& f) { shift(f, 0.5); }},
      {"track 0.5 s late", [](FlightData& f) { shift(f, -0.5); }},
      {"30 % + 0.3 to 2 m", block_some},
      {"one anchor blocked", block_first_anchor, true},
      {"every second anchor blocked", block_every_second_anchor},
      {"every 20th range", keep_every_20th},
      {"first third", [](FlightData& f) { keep_part(f, 0, 1.0 / 3); }},
      {"one side", keep_one_side},
      {"one side 0.5 m late", delay_one_side},
      {"lever arm 0.3 m off", declare_arm_wrongly},
      {"anchors exchanged", exchange_two_anchors_half_way},
  };
  int anchors = 0, accepted = 0, outside = 0;
  for (const char* name : {"rcv-drone", "inrol-mocap"}) {
    FlightSet set = testing::read_set(name);
    std::vector<const FlightData*> pointers;
    for (const auto& flight : set.flights) pointers.push_back(&flight);
    FlightOptions with_profile;
    (void)solve_flights(pointers, {}, &with_profile.profile.emplace()).value();
    for (std::size_t i = 0; i < set.flights.size(); ++i) {
      // One flight of the large set is enough.
      if (set.name == "inrol-mocap" && set.flights[i].mission.name != "env1_calib") continue;
      for (const Spoilt& way : ways) {
        FlightData flight = set.flights[i];
        way.spoil(flight);
        for (const bool profile : {false, true}) {
          if (profile && !way.with_profile) continue;
          const auto solution = solve_flight(flight, profile ? with_profile : FlightOptions{});
          if (!solution) continue;  // no answer is no wrong answer
          for (const AnchorError& one : testing::assess(set, i, solution.value())) {
            ++anchors;
            const Estimate& e = one.solution.estimate;
            if (!e.acceptable()) continue;
            ++accepted;
            if (one.inside) continue;
            ++outside;
            std::printf("%s %s, %s%s: off by %.3f m, claimed %.3f m\n", set.flights[i].mission.name.c_str(),
                        one.solution.name.c_str(), way.how, profile ? ", with profile" : "", one.error_m(),
                        one.claimed_3d_m);
            // 95 % regions miss one anchor in twenty, by a little.
            EXPECT_LT(one.error_m(), 1.2 * one.claimed_3d_m);
          }
        }
      }
    }
  }
  std::printf("%d anchors, %d accepted, %d of them outside of their 95 %% region\n", anchors, accepted,
              outside);
  EXPECT_LE(outside, accepted / 10) << "one in twenty, of flights that are spoilt";
}

// h95 0.172 m became 0.138 m and two of four anchors lay outside: what is off by metres was taken for noise
// that averages out.
TEST(SpoiltRealFlights, AreNotClaimedBetterThanClean) {
  if (!std::filesystem::exists(ANCHORD_SHARED_DATA)) {
    std::printf("SKIPPED: no real flights, looked for %s\n", ANCHORD_SHARED_DATA);
    GTEST_SKIP() << "no real flights, looked for " << ANCHORD_SHARED_DATA;
  }
  const FlightSet set = testing::read_set("rcv-drone");
  double before_m = 0;
  for (const double share : {0.0, 0.1, 0.3, 0.5}) {
    FlightData flight = set.flights.front();
    std::mt19937_64 random(5);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (auto& range : flight.ranges)
      if (uniform(random) < share) range.distance_m += 20.0 * uniform(random);
    const auto solution = solve_flight(flight).value();
    const auto anchors = testing::assess(set, 0, solution);
    double least_m = 1e9;
    for (const AnchorError& one : anchors) least_m = std::min(least_m, one.solution.estimate.h95_m);
    const auto sum = testing::summary(anchors);
    std::printf("seq1, %2.0f %% of the ranges 0 to 20 m long: least h95 %.3f m, %d of %d inside\n",
                100 * share, least_m, sum.inside, sum.n);
    EXPECT_EQ(sum.inside, sum.n) << share;
    EXPECT_GE(least_m, before_m) << share;
    before_m = least_m;
  }
}

}  // namespace
}  // namespace anchord::real_flights_spoilt_test
