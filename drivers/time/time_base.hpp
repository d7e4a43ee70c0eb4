#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/time.hpp"
#include "drivers/link/byte_link.hpp"
#include "drivers/time/clock_model.hpp"

namespace anchord::timing {

/// UTC with its standard uncertainty.
struct UtcStamp {
  UtcTime time{};
  double sigma_s{};
};

enum class TimeSource : std::uint8_t { system_clock, receiver };

/// UTC of any instant of the steady clock: from a GNSS receiver once ten seconds of it were heard, before
/// that from the system clock as it stood at the first arrival. Either way later steps of the system clock
/// move nothing; they are only noticed. Pure: time comes in with the arrivals. Not thread-safe.
class TimeBase {
 public:
  /// Every arrival of every device, in order.
  void arrived(const link::Arrival& at);
  /// A receiver's time of measurement and when its last byte arrived. `latency_s`: what the receiver and the
  /// link need at least (setting of the device); one receiver serves, the first that speaks. Another takes
  /// over once that one was removed, or silent for k_silent_s, and ten seconds of the other were heard.
  void receiver_said(int receiver, UtcTime measured, const link::Arrival& at, double latency_s);
  /// Its link was lost, or it was removed.
  void receiver_gone(int receiver);

  /// 0.5 s is what a computer without NTP may be off at best; a receiver is known to its latency.
  UtcStamp utc_of(std::int64_t steady_ns) const;
  TimeSource source() const;

  /// System clock minus UTC of the receiver, seconds; absent without a receiver.
  std::optional<double> system_offset_s() const;
  /// One line when the system clock is wrong or stepped (reliability.md: 50 ms beyond what is explained).
  std::optional<std::string> skew() const;
  const ClockModel& receiver_model() const { return receiver_; }

  static constexpr double k_latency_sigma_s = 0.02;  ///< of receivers' computing time, between makes
  static constexpr double k_skew_limit_s = 0.05;
  static constexpr double k_silent_s = 30;

 private:
  struct Heir {
    int id{};
    ClockModel model;
  };
  ClockModel receiver_;
  std::optional<int> receiver_id_{};
  std::optional<std::int64_t> heard_ns_{};  ///< steady, of the one that serves; absent: it is gone
  std::optional<Heir> heir_{};              ///< who takes over once its own fit is settled
  double latency_s_{0};
  std::optional<std::int64_t> pinned_ns_{};  ///< system UTC minus steady, at the first arrival
  std::int64_t system_ns_{0};                ///< the same, at the newest
  std::int64_t newest_ns_{0};                ///< steady
};

}  // namespace anchord::timing
