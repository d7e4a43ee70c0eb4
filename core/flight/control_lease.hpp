#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"

namespace anchord::flight {

/// Who has the aircraft. Many may watch, one may command.
struct Lease {
  MissionId mission{};
  std::string key;  ///< known to the holder alone; two browsers of one person are two
  std::string token_id, name;
  UtcTime since{};
  UtcTime until{};            ///< for people: by the system clock as it stood when this was read
  SteadyTime until_steady{};  ///< what counts
};
/// What may be asked of it. ask shows the holder an event; refuse answers it.
enum class ControlAction : std::uint8_t { take, renew, release, ask, refuse };
inline constexpr auto k_control_words = enum_table<ControlAction>({{"take", ControlAction::take},
                                                                   {"renew", ControlAction::renew},
                                                                   {"release", ControlAction::release},
                                                                   {"ask", ControlAction::ask},
                                                                   {"refuse", ControlAction::refuse}});

/// Who asks.
struct Holder {
  std::string token_id, name;
};
/// Now, for a stamp and for a duration.
struct Moment {
  UtcTime utc{};
  SteadyTime steady{};
};

/// The one lease of the one aircraft. Ends by itself unless it is renewed; every command renews it. Runs on
/// the steady clock: no step of the system clock ends or prolongs it. Not thread-safe: its owner locks.
class ControlLease {
 public:
  static constexpr std::int64_t k_lasts_ns = 60'000'000'000;

  /// conflict, naming the holder, while somebody else has it; `by_force` takes it from them. `key`: a fresh
  /// one.
  Result<Lease> take(const MissionId& mission, const Holder& who, const Moment& now, bool by_force,
                     std::string key);
  /// Longer by a minute. conflict when the key is not the holder's, or the lease has ended.
  Result<Lease> renew(const MissionId& mission, const std::string& key, const Holder& who, const Moment& now);
  Result<void> release(const MissionId& mission, const std::string& key, const Holder& who,
                       const Moment& now);
  std::optional<Lease> holder(const Moment& now) const;
  /// True once, when a lease has run out.
  bool just_ended(const Moment& now);

 private:
  std::optional<Lease> lease_;
};

}  // namespace anchord::flight
