#include "core/flight/pulse.hpp"

#include <algorithm>

namespace anchord::flight {
namespace {

constexpr std::size_t k_looks = 10;
// One range in five of the newest fifty: single odd ones are what withholding is for.
constexpr std::size_t k_judged = 50, k_many_withheld = 10;
constexpr double k_unknown_tag_s = 10;
constexpr std::size_t k_ahead_ranges = 20;
// A wall moves no anchor by more, and no anchor so far that its own uncertainty could.
constexpr double k_moved_m = 3, k_moved_regions = 3;

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

void FlightWatch::note_range(UtcTime measured, std::optional<UtcTime> received) {
  if (received) {
    ahead_s_.push_back(seconds_between(*received, measured));
    if (ahead_s_.size() > k_ahead_ranges) ahead_s_.pop_front();
  }
  if (!pulse_.first_range) pulse_.first_range = measured;
  if (!pulse_.newest_range || *pulse_.newest_range < measured) pulse_.newest_range = measured;
}

void FlightWatch::note_unknown_tag(NetworkId tag, UtcTime measured, const std::string& known_tags) {
  unknown_tags_[tag] = measured;
  pulse_.known_tags = known_tags;
}

void FlightWatch::note_lag(double lag_s, double sigma_s) {
  pulse_.lag_s = lag_s;
  pulse_.lag_sigma_s = sigma_s;
}

void FlightWatch::note_model(std::string_view withheld) {
  withheld_.push_back(withheld);
  if (withheld_.size() > k_judged) withheld_.pop_front();
  std::size_t n = 0;
  std::string_view why;
  for (const auto& one : withheld_) {
    if (one.empty()) continue;
    ++n;
    why = one;
  }
  pulse_.models_withheld = n >= k_many_withheld ? why : std::string_view{};
}

void FlightWatch::note_moved(NetworkId anchor, std::optional<double> moved_m, double known_to_m) {
  const bool far = moved_m && *moved_m > k_moved_m && *moved_m > k_moved_regions * known_to_m;
  if (far == moved_.contains(anchor)) return;
  if (far)
    moved_.insert(anchor);
  else
    moved_.erase(anchor);
  pulse_.models_moved.clear();
  for (const auto id : moved_)
    pulse_.models_moved += (pulse_.models_moved.empty() ? "" : ", ") + to_string(id);
}

FlightPulse FlightWatch::look(UtcTime newest_measured, Steady now) {
  // The least of some: one that waited on its way says nothing of the clock.
  pulse_.ahead_s =
      ahead_s_.size() == k_ahead_ranges ? std::optional(*std::ranges::min_element(ahead_s_)) : std::nullopt;
  pulse_.unknown_tags.clear();
  for (const auto& [tag, measured] : unknown_tags_)
    if (seconds_between(measured, newest_measured) < k_unknown_tag_s)
      pulse_.unknown_tags += (pulse_.unknown_tags.empty() ? "" : ", ") + to_string(tag);
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
