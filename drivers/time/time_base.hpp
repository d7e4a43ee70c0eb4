#pragma once

#include <cstdint>
#include <functional>
#include <map>
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

/// What is thought of the date that a receiver gives.
enum class Belief : std::uint8_t {
  believed,
  impossible,  ///< before this version of anchord, or 1024 weeks after that: most often a GPS week rollover
  outvoted,    ///< in that span, but the system clock and other receivers agree on another one
};

/// The only 1024 weeks in which a date can be: each rollover of the week leaves them, so none passes for
/// right, whatever the system clock says. A constant, not the day of the build: recordings replay the same.
inline constexpr std::int64_t k_first_possible_ns = 1'704'067'200'000'000'000;  // 2024-01-01
inline constexpr std::int64_t k_rollover_ns = 1024LL * 7 * 86'400 * 1'000'000'000;

/// UTC of any instant of the steady clock: from a GNSS receiver once ten seconds of it were heard, before
/// that from the system clock as it stood at the first arrival. Either way later steps of the system clock
/// move nothing; they are only noticed. Pure: time comes in with the arrivals. Not thread-safe.
///
/// A receiver with a fix wins over the system clock (a laptop in the field may have lost its date), but not
/// with an impossible date that the system clock does not share, and not where it is alone against the
/// system clock and another receiver, or against two.
class TimeBase {
 public:
  /// Name of a receiver, for people.
  using Names = std::function<std::string(int)>;

  /// Every arrival of every device, in order.
  void arrived(const link::Arrival& at);
  /// A receiver's time of measurement, with a fix, and when its last byte arrived. `latency_s`: what the
  /// receiver and the link need at least (setting of the device); one receiver serves, the first that speaks
  /// and is believed. Another takes over once that one was removed, is not believed, or silent for
  /// k_silent_s, and ten seconds of the other were heard. What is not believed teaches nothing.
  Belief receiver_said(int receiver, UtcTime measured, const link::Arrival& at, double latency_s);
  /// Its link was lost, or it was removed.
  void receiver_gone(int receiver);

  /// 0.5 s is what a computer without NTP may be off at best; a receiver is known to its latency.
  UtcStamp utc_of(std::int64_t steady_ns) const;
  TimeSource source() const;

  /// System clock minus UTC of the receiver, seconds; absent without a receiver.
  std::optional<double> system_offset_s() const;
  /// Why a receiver's newest date is not believed and what to do, without its name; absent: it is.
  std::optional<std::string> doubt(int receiver) const;
  /// One line when the system clock is wrong or stepped (reliability.md: 50 ms beyond what is explained), or
  /// a receiver's date: whose, and what to do.
  std::optional<std::string> skew(const Names& names = {}) const;
  const ClockModel& receiver_model() const { return receiver_; }

  static constexpr double k_latency_sigma_s = 0.02;  ///< of receivers' computing time, between makes
  static constexpr double k_skew_limit_s = 0.05;
  static constexpr double k_silent_s = 30;
  /// Receivers further apart are told: beyond what links delay, below the two leap seconds of a cold start.
  static constexpr double k_apart_s = 1.5;
  static constexpr double k_other_date_s = 3 * 86'400.0;  ///< no zone, no midnight explains that

 private:
  struct Heir {
    int id{};
    ClockModel model;
  };
  /// What a receiver says, as UTC minus steady: the greatest of ten to twenty seconds, since delays only
  /// lessen.
  struct Claim {
    std::int64_t said_ns{}, bucket_ns{}, former_ns{};
    std::int64_t bucket_since_ns{}, heard_ns{};  ///< steady
    Belief belief{};
    std::int64_t offset_ns() const { return bucket_ns > former_ns ? bucket_ns : former_ns; }
  };
  void teach(int receiver, UtcTime measured, const link::Arrival& at, double latency_s);
  void forget(int receiver);
  void claim(int receiver, std::int64_t offset_ns, std::int64_t steady_ns);
  Belief judge(int receiver) const;
  bool is_fresh(const Claim& claim) const;
  bool speaks(const Claim& claim) const;
  int votes(int receiver) const;
  bool known_today(std::int64_t offset_ns) const;
  std::optional<std::string> skew_of_receivers(const Names& names) const;

  std::map<int, Claim> claims_;  ///< one a receiver that is connected
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
