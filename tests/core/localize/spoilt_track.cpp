#include "tests/core/localize/spoilt_track.hpp"

#include <algorithm>
#include <random>

#include "core/geo/enu.hpp"

namespace anchord::testing {
namespace {

Eigen::Vector3d jump(std::mt19937_64& random, bool height_only) {
  std::uniform_real_distribution<double> size_m(1, 50);
  std::normal_distribution<double> axis(0, 1);
  const double m = size_m(random);
  Eigen::Vector3d direction(axis(random), axis(random), axis(random));
  if (height_only) direction = {0, 0, direction.z() < 0 ? -1.0 : 1.0};
  return m * direction.normalized();
}

void spoil_some(std::vector<Fix>& fixes, double share, bool height_only) {
  std::mt19937_64 random(3);
  std::bernoulli_distribution one(share);
  for (auto& fix : fixes)
    if (one(random)) move(fix, jump(random, height_only));
}

void spoil_start(std::vector<Fix>& fixes, double seconds, const Eigen::Vector3d& by_m) {
  const UtcTime start = fixes.front().time;
  for (auto& fix : fixes)
    if (seconds_between(start, fix.time) < seconds) move(fix, by_m);
}

/// One in twenty, or so.
void stamp_some(std::vector<Fix>& fixes, double by_s) {
  std::mt19937_64 random(4);
  std::bernoulli_distribution one(0.05);
  for (auto& fix : fixes)
    if (one(random)) fix.time.ns += static_cast<std::int64_t>(by_s * 1e9);
}

}  // namespace

void move(Fix& fix, const Eigen::Vector3d& by_m) {
  if (fix.frame == TrackFrame::local) {
    fix.local_m += by_m;
    return;
  }
  fix.position = EnuFrame(fix.position).wgs84_from_enu({by_m});
}

double apart_m(const Wgs84& a, const Wgs84& b) { return (ecef_from_wgs84(a) - ecef_from_wgs84(b)).norm(); }

const std::vector<SpoiltWay>& spoilt_ways() {
  using Fixes = std::vector<Fix>;
  static const std::vector<SpoiltWay> k_ways{
      {"first_fix_33_km",
       [](Fixes& f) {
         move(f.front(), {33'000, 0, 0});
       }},
      {"last_fix_33_km",
       [](Fixes& f) {
         move(f.back(), {0, -33'000, 0});
       }},
      {"single_fixes_far",
       [](Fixes& f) {
         for (std::size_t i = 3; i < f.size(); i += f.size() / 7) move(f[i], {0, 500, 0});
       }},
      {"first_two_seconds_20_m",
       [](Fixes& f) {
         spoil_start(f, 2, {20, 0, 0});
       }},
      {"first_two_seconds_33_km",
       [](Fixes& f) {
         spoil_start(f, 2, {33'000, 0, 0});
       }},
      {"five_percent_jumps", [](Fixes& f) { spoil_some(f, 0.05, false); }},
      {"five_percent_height", [](Fixes& f) { spoil_some(f, 0.05, true); }},
      {"age_120_s",
       [](Fixes& f) {
         // With the position it had when the corrections stopped coming.
         for (std::size_t i = f.size() / 2; i < f.size() / 2 + 30 && i < f.size(); ++i) {
           f[i].correction_age_s = 120;
           move(f[i], {0.4, 0, 0});
         }
       }},
      {"stamps_of_tomorrow", [](Fixes& f) { stamp_some(f, 86'400); }},
      {"stamps_a_minute_ahead", [](Fixes& f) { stamp_some(f, 60); }},
      {"first_stamp_of_tomorrow", [](Fixes& f) { f.front().time.ns += 86'400'000'000'000; }},
  };
  return k_ways;
}

void play(LiveFlight& live, const FlightData& flight) {
  auto ranges = flight.ranges;
  std::ranges::stable_sort(ranges, {}, &Range::time);
  std::size_t next = 0;
  const UtcTime end = ranges.empty() ? UtcTime{} : ranges.back().time;
  for (const Fix& fix : flight.fixes) {
    while (next < ranges.size() && fix.time <= end && ranges[next].time < fix.time) live.add(ranges[next++]);
    live.add(fix);
  }
  while (next < ranges.size()) live.add(ranges[next++]);
  live.finish();
}

}  // namespace anchord::testing
