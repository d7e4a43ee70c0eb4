#include "core/flight/pulse.hpp"

namespace anchord::flight {
namespace {

constexpr std::size_t k_looks = 10;

}  // namespace

void FlightWatch::note(const Fix& fix) {
  if (pulse_.newest_fix && fix.time < *pulse_.newest_fix) return;
  const auto since = [&](std::optional<UtcTime>& began, bool holds) {
    if (!holds)
      began.reset();
    else if (!began)
      began = fix.time;
  };
  pulse_.newest_fix = fix.time;
  pulse_.fix = fix.fix;
  pulse_.correction_age_s = fix.correction_age_s;
  since(pulse_.below_float_since, fix.fix < FixClass::rtk_float);
  since(pulse_.float_since, fix.fix == FixClass::rtk_float);
}

void FlightWatch::note_range(UtcTime measured) {
  if (!pulse_.newest_range || *pulse_.newest_range < measured) pulse_.newest_range = measured;
}

void FlightWatch::note_lag(double lag_s, double sigma_s) {
  pulse_.lag_s = lag_s;
  pulse_.lag_sigma_s = sigma_s;
}

FlightPulse FlightWatch::look(UtcTime newest_measured, Steady now) {
  looks_.emplace_back(newest_measured, now);
  if (looks_.size() > k_looks) looks_.pop_front();
  if (looks_.size() == k_looks) {
    const double measured_s = seconds_between(looks_.front().first, looks_.back().first);
    const double passed_s =
        std::chrono::duration<double>(looks_.back().second - looks_.front().second).count();
    if (measured_s > 1.5 * passed_s + 1)
      pulse_.as_it_happens = false;
    else if (measured_s > 0.3 * passed_s)
      pulse_.as_it_happens = true;
  }
  return pulse_;
}

}  // namespace anchord::flight
