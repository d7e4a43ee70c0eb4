#include "drivers/time/time_base.hpp"

#include <cmath>
#include <cstdio>
#include <utility>

namespace anchord::timing {

void TimeBase::arrived(const link::Arrival& at) {
  system_ns_ = at.utc.ns - at.steady_ns;
  newest_ns_ = at.steady_ns;
  if (!pinned_ns_) pinned_ns_ = system_ns_;
}

void TimeBase::receiver_said(int receiver, UtcTime measured, const link::Arrival& at, double latency_s) {
  arrived(at);
  if (!receiver_id_) receiver_id_ = receiver;
  if (receiver_id_ == receiver) {
    heard_ns_ = at.steady_ns;
    heir_.reset();
    latency_s_ = latency_s;
    return receiver_.add(measured.ns, at.steady_ns);
  }
  if (heard_ns_ && static_cast<double>(at.steady_ns - *heard_ns_) * 1e-9 < k_silent_s) return;
  if (!heir_) heir_ = Heir{receiver, ClockModel{}};
  if (heir_->id != receiver) return;
  heir_->model.add(measured.ns, at.steady_ns);
  if (!heir_->model.settled()) return;
  receiver_ = std::move(heir_->model);
  receiver_id_ = receiver;
  heard_ns_ = at.steady_ns;
  latency_s_ = latency_s;
  heir_.reset();
}

void TimeBase::receiver_gone(int receiver) {
  if (heir_ && heir_->id == receiver) heir_.reset();
  if (receiver_id_ != receiver) return;
  // What it taught us stays true for minutes, until the fit of another is settled.
  heard_ns_.reset();
  if (receiver_.settled()) return;
  receiver_id_.reset();
  receiver_ = ClockModel{};
}

TimeSource TimeBase::source() const {
  return receiver_.settled() ? TimeSource::receiver : TimeSource::system_clock;
}

UtcStamp TimeBase::utc_of(std::int64_t steady_ns) const {
  if (source() == TimeSource::receiver) {
    if (const auto stamp = receiver_.device_of(steady_ns)) {
      return {UtcTime{stamp->ns + static_cast<std::int64_t>(latency_s_ * 1e9)},
              std::hypot(stamp->sigma_ns * 1e-9, k_latency_sigma_s)};
    }
  }
  return {UtcTime{pinned_ns_.value_or(0) + steady_ns}, 0.5};
}

std::optional<double> TimeBase::system_offset_s() const {
  if (source() != TimeSource::receiver) return std::nullopt;
  return static_cast<double>(system_ns_ + newest_ns_ - utc_of(newest_ns_).time.ns) * 1e-9;
}

namespace {

/// The greatest of 0.01, 0.02, 0.05, 0.1, ... that is not above (0.01 and up): the text of an alarm must not
/// change with every millisecond.
double round_down(double value_s) {
  double step = 0.01;
  while (step * 10 <= value_s && step < 1e9) step *= 10;
  return value_s >= 5 * step ? 5 * step : value_s >= 2 * step ? 2 * step : step;
}

}  // namespace

std::optional<std::string> TimeBase::skew() const {
  char text[160];
  if (const auto offset = system_offset_s()) {
    const double allowed = k_skew_limit_s + 3 * k_latency_sigma_s;
    if (std::abs(*offset) <= allowed) return std::nullopt;
    std::snprintf(text, sizeof text, "the system clock is more than %g s %s the receiver's UTC",
                  round_down(std::abs(*offset)), *offset > 0 ? "ahead of" : "behind");
    return text;
  }
  const double stepped = static_cast<double>(system_ns_ - pinned_ns_.value_or(system_ns_)) * 1e-9;
  if (std::abs(stepped) <= k_skew_limit_s) return std::nullopt;
  std::snprintf(text, sizeof text, "the system clock was moved %s by more than %g s since the start",
                stepped > 0 ? "ahead" : "back", round_down(std::abs(stepped)));
  return text;
}

}  // namespace anchord::timing
