#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"
#include "core/types/fix.hpp"

namespace anchord::api {

/// How a flight that records stands now. Measured times are of the rows, arrivals of the steady clock:
/// silence is a duration.
struct FlightPulse {
  MissionId mission{};
  std::string name;
  SteadyTime now{};
  std::optional<UtcTime> newest_fix{}, newest_range{};        ///< measured
  std::optional<SteadyTime> fix_arrival{}, range_arrival{};   ///< newest of each
  FixClass fix{FixClass::none};                               ///< of the newest
  std::optional<UtcTime> below_float_since{}, float_since{};  ///< measured; absent while it is better
  std::optional<double> correction_age_s{};                   ///< of the newest fix, where it says
  std::optional<double> lag_s{}, lag_sigma_s{};               ///< of the joint solution
  bool as_it_happens{false};  ///< rows come about as fast as they were measured: no upload, no fast replay
};

enum class AlarmPriority : std::uint8_t { critical, warning, advisory };

/// A condition that holds, in words. The text has no running numbers: it would change each second.
struct AlarmCondition {
  std::string id;  ///< of dashboard.md section 6
  AlarmPriority priority{AlarmPriority::warning};
  std::string text;
  std::optional<MissionId> mission{};
};

struct ServerPulse {
  bool writable{true};
  std::string reason{};
  std::uint64_t disk_free_bytes{};  ///< 0: not known
  std::uint64_t queued_rows{};      ///< wait for the writer or for the live path
  std::string clock_skew{};         ///< the system clock against the receiver's, in words; empty: right
  std::string failed_tasks{};       ///< of the server, with what they threw; empty: none lately
  std::string not_started{};        ///< devices that are kept but do not run, and why; empty: all do
  std::string unrecorded{};         ///< why raw bytes of the devices are not recorded; empty: they are
};

/// Every condition that holds (dashboard.md section 6, reliability.md section 2). Pure. Of several flights
/// the worst word of each id counts; flights that are uploaded or replayed fast raise nothing, and neither
/// does one that fell silent more than 30 s ago: it is over, whatever its state says.
std::vector<AlarmCondition> alarm_conditions(const std::vector<FlightPulse>& flights,
                                             const ServerPulse& server);

}  // namespace anchord::api
