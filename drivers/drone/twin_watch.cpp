#include "drivers/drone/twin_watch.hpp"

#include <algorithm>
#include <cmath>

#include "core/base/angle.hpp"

namespace anchord::drone {
namespace {

constexpr double k_window_s = 8;
constexpr std::size_t k_back = 3, k_jumps = 4, k_arms = 6, k_kept = 16;
/// More than what a link puts out of order.
constexpr std::int64_t k_back_ms = 3'000;
/// Further than a position filter corrects itself, and faster than a multirotor flies.
constexpr double k_jump_m = 30, k_jump_mps = 50;
constexpr double k_degree_m = 111'195;  // mean earth radius 6371 km

double across_m(const Wgs84& a, const Wgs84& b) {
  return k_degree_m *
         std::hypot(a.lat_deg - b.lat_deg, (a.lon_deg - b.lon_deg) * std::cos(a.lat_deg * k_degree));
}

}  // namespace

void TwinWatch::Sign::note(double now_s) {
  at_s.push_back(now_s);
  if (at_s.size() > k_kept) at_s.pop_front();
}

bool TwinWatch::Sign::times(double now_s, std::size_t n) const {
  return static_cast<std::size_t>(
             std::count_if(at_s.begin(), at_s.end(), [&](double t) { return now_s - t <= k_window_s; })) >= n;
}

void TwinWatch::heartbeat(double now_s, bool armed) {
  if (armed_ && *armed_ != armed) arm_.note(now_s);
  armed_ = armed;
}

void TwinWatch::position(double now_s, std::int64_t boot_ms, const std::optional<Wgs84>& place) {
  if (boot_ms_ && boot_ms + k_back_ms < *boot_ms_) boot_.note(now_s);
  boot_ms_ = boot_ms;
  if (!place) return;
  const double moved_m = place_ ? across_m(*place_, *place) : 0;
  if (moved_m > k_jump_m && moved_m > k_jump_mps * (now_s - place_s_)) jump_.note(now_s);
  place_ = place;
  place_s_ = now_s;
}

bool TwinWatch::two(double now_s) const {
  return boot_.times(now_s, k_back) || jump_.times(now_s, k_jumps) || arm_.times(now_s, k_arms);
}

}  // namespace anchord::drone
