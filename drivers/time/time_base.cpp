#include "drivers/time/time_base.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>

namespace anchord::timing {
namespace {

constexpr std::int64_t k_bucket_ns = 10'000'000'000;
constexpr double k_longest_link_s = 5;  ///< what a slow radio or a busy bridge delays at most
constexpr auto k_other_date_ns = static_cast<std::int64_t>(TimeBase::k_other_date_s * 1e9);

bool possible(std::int64_t utc_ns) {
  return utc_ns >= k_first_possible_ns && utc_ns < k_first_possible_ns + k_rollover_ns;
}

std::string date_of(std::int64_t utc_ns) { return to_rfc3339(UtcTime{utc_ns}).substr(0, 10); }

}  // namespace

void TimeBase::arrived(const link::Arrival& at) {
  system_ns_ = at.utc.ns - at.steady_ns;
  newest_ns_ = at.steady_ns;
  if (!pinned_ns_) pinned_ns_ = system_ns_;
}

Belief TimeBase::receiver_said(int receiver, UtcTime measured, const link::Arrival& at, double latency_s) {
  arrived(at);
  claim(receiver, measured.ns - at.steady_ns, at.steady_ns);
  const auto belief = claims_[receiver].belief = judge(receiver);
  if (belief == Belief::believed) {
    teach(receiver, measured, at, latency_s);
  } else {
    forget(receiver);
  }
  return belief;
}

void TimeBase::teach(int receiver, UtcTime measured, const link::Arrival& at, double latency_s) {
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
  claims_.erase(receiver);
  forget(receiver);
}

void TimeBase::forget(int receiver) {
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

void TimeBase::claim(int receiver, std::int64_t offset_ns, std::int64_t steady_ns) {
  auto& c = claims_[receiver];
  // A date that was set anew says nothing of the one before.
  const bool first = c.heard_ns == 0 || std::abs(offset_ns - c.said_ns) > k_other_date_ns;
  if (first) {
    c.bucket_ns = c.former_ns = offset_ns;
    c.bucket_since_ns = steady_ns;
  } else if (steady_ns - c.bucket_since_ns > k_bucket_ns) {
    c.former_ns = std::exchange(c.bucket_ns, offset_ns);
    c.bucket_since_ns = steady_ns;
  }
  c.bucket_ns = std::max(c.bucket_ns, offset_ns);
  c.said_ns = offset_ns;
  c.heard_ns = steady_ns;
}

bool TimeBase::is_fresh(const Claim& c) const {
  return static_cast<double>(newest_ns_ - c.heard_ns) * 1e-9 < k_silent_s;
}

bool TimeBase::speaks(const Claim& c) const { return c.belief != Belief::impossible && is_fresh(c); }

int TimeBase::votes(int receiver) const {
  const auto said_ns = claims_.at(receiver).said_ns;
  const auto agrees = [&](std::int64_t other_ns) { return std::abs(other_ns - said_ns) <= k_other_date_ns; };
  int out = possible(system_ns_ + newest_ns_) && agrees(system_ns_) ? 1 : 0;
  for (const auto& [other, c] : claims_) out += other != receiver && speaks(c) && agrees(c.said_ns) ? 1 : 0;
  return out;
}

Belief TimeBase::judge(int receiver) const {
  const auto& own = claims_.at(receiver);
  const bool as_the_system = std::abs(own.said_ns - system_ns_) <= k_other_date_ns;
  if (!as_the_system && !possible(own.said_ns + own.heard_ns)) return Belief::impossible;
  for (const auto& [other, c] : claims_) {
    const bool apart = std::abs(c.said_ns - own.said_ns) > k_other_date_ns;
    if (other != receiver && speaks(c) && apart && votes(other) > votes(receiver)) return Belief::outvoted;
  }
  return Belief::believed;
}

std::optional<std::string> TimeBase::doubt(int receiver) const {
  const auto found = claims_.find(receiver);
  if (found == claims_.end() || found->second.belief == Belief::believed) return std::nullopt;
  const auto& c = found->second;
  const std::int64_t now_ns = c.said_ns + c.heard_ns;
  const std::string not_used = "; its positions and its time are not used. ";
  if (c.belief == Belief::outvoted) {
    return "the receiver says " + date_of(now_ns) + ", and the other clocks agree on another date" +
           not_used + "Restart the receiver cold, or use another one";
  }
  // Which rollover it is, if any: the one that makes it the date of today.
  for (int rollovers = -2; rollovers <= 2; ++rollovers) {
    const std::int64_t right_ns = now_ns + rollovers * k_rollover_ns;
    if (rollovers == 0 || !possible(right_ns) || !known_today(right_ns - c.heard_ns)) continue;
    return "the receiver says " + date_of(now_ns) + ", " + std::to_string(std::abs(rollovers) * 1024) +
           " weeks " + (rollovers > 0 ? "early" : "late") + " (GPS week rollover)" + not_used +
           "Update its firmware, or use another one";
  }
  return "the receiver says " + date_of(now_ns) + ", which cannot be (a GPS week rollover, or no date yet)" +
         not_used + "Restart it cold, update its firmware, or use another one";
}

bool TimeBase::known_today(std::int64_t offset_ns) const {
  const auto near = [&](std::int64_t other_ns) { return std::abs(other_ns - offset_ns) <= k_other_date_ns; };
  return near(system_ns_) || std::any_of(claims_.begin(), claims_.end(), [&](const auto& claim) {
           return speaks(claim.second) && near(claim.second.said_ns);
         });
}

namespace {

/// The greatest of 0.01, 0.02, 0.05, 0.1, ... that is not above (0.01 and up): the text of an alarm must not
/// change with every millisecond.
double round_down(double value_s) {
  double step = 0.01;
  while (step * 10 <= value_s && step < 1e9) step *= 10;
  return value_s >= 5 * step ? 5 * step : value_s >= 2 * step ? 2 * step : step;
}

std::string seconds_text(double value_s) {
  const double days = value_s / 86'400;
  std::array<char, 32> text{};
  if (days < 2)
    std::snprintf(text.data(), text.size(), value_s < 1 ? "%g s" : "%.0f s", round_down(value_s));
  else
    std::snprintf(text.data(), text.size(), "%.0f days", round_down(days));
  return text.data();
}

}  // namespace

std::optional<std::string> TimeBase::skew_of_receivers(const Names& names) const {
  const auto name = [&](int id) { return names ? "device \"" + names(id) + '"' : "a receiver"; };
  for (const auto& [id, c] : claims_) {
    const auto why = is_fresh(c) ? doubt(id) : std::nullopt;
    if (!why) continue;
    std::string others;
    for (const auto& [other, d] : claims_)
      if (other != id && speaks(d) && d.belief == Belief::believed)
        others += (others.empty() ? " (" : ", ") + name(other) + " says " + date_of(d.said_ns + newest_ns_);
    return name(id) + ": " + *why + others + (others.empty() ? "" : ")");
  }
  const auto serving = receiver_id_ ? claims_.find(*receiver_id_) : claims_.end();
  if (serving == claims_.end() || !speaks(serving->second)) return std::nullopt;
  for (const auto& [id, c] : claims_) {
    const auto apart_ns = c.offset_ns() - serving->second.offset_ns();
    const double apart_s = static_cast<double>(std::abs(apart_ns)) * 1e-9;
    if (id == serving->first || !speaks(c) || apart_s <= k_apart_s) continue;
    const bool dates = apart_s > k_other_date_s;
    const auto say = [&](int of, const Claim& its) {
      return name(of) + (dates ? " says " + date_of(its.said_ns + newest_ns_) : "");
    };
    return "two receivers disagree: " + say(id, c) +
           (dates ? ", "
                  : " is more than " + seconds_text(apart_s) + (apart_ns > 0 ? " ahead of " : " behind ")) +
           say(serving->first, serving->second) +
           ", whose time is used: find out which one is wrong and switch it off";
  }
  return std::nullopt;
}

std::optional<std::string> TimeBase::skew(const Names& names) const {
  if (auto of_receivers = skew_of_receivers(names)) return of_receivers;
  if (const auto offset = system_offset_s()) {
    const double allowed = k_skew_limit_s + 3 * k_latency_sigma_s;
    if (std::abs(*offset) <= allowed) return std::nullopt;
    const bool named = names && receiver_id_;
    const std::string whose =
        named ? "the UTC of device \"" + names(*receiver_id_) + '"' : "the receiver's UTC";
    if (std::abs(*offset) > k_other_date_s) {
      return "the system clock says " + date_of(system_ns_ + newest_ns_) + ", " + whose + " " +
             date_of(utc_of(newest_ns_).time.ns) + ", which is used: set the clock of this computer (NTP)";
    }
    return "the system clock is more than " + seconds_text(std::abs(*offset)) +
           (*offset > 0 ? " ahead of " : " behind ") + whose + ": set the clock of this computer (NTP)" +
           (*offset > 0 && *offset < k_longest_link_s
                ? "; where that is right, the receiver's link takes so long: give its latency_ms"
                : "");
  }
  if (!pinned_ns_) return std::nullopt;
  if (!possible(system_ns_ + newest_ns_)) {
    return "the system clock says " + date_of(system_ns_ + newest_ns_) +
           ", which cannot be: set the clock of this computer (NTP), or connect a GNSS receiver";
  }
  const double stepped = static_cast<double>(system_ns_ - *pinned_ns_) * 1e-9;
  if (std::abs(stepped) <= k_skew_limit_s) return std::nullopt;
  return std::string("the system clock was moved ") + (stepped > 0 ? "ahead" : "back") + " by more than " +
         seconds_text(std::abs(stepped)) + " since the start";
}

}  // namespace anchord::timing
