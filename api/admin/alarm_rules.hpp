#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/ids.hpp"
#include "core/flight/pulse.hpp"

namespace anchord::api {

using flight::FlightPulse;

enum class AlarmPriority : std::uint8_t { critical, warning, advisory };
inline constexpr auto k_alarm_priority_words =
    enum_table<AlarmPriority>({{"critical", AlarmPriority::critical},
                               {"warning", AlarmPriority::warning},
                               {"advisory", AlarmPriority::advisory}});

/// A condition that holds, in words. The text has no running numbers: it would change each second.
struct AlarmCondition {
  std::string id;  ///< of dashboard.md section 6; with the mission it is the alarm's key
  AlarmPriority priority{AlarmPriority::warning};
  std::string text;
  std::optional<MissionId> mission{};
  bool of_sites{false};  ///< its text names what is of several sites
  bool is(std::string_view an_id, const std::optional<MissionId>& of) const {
    return id == an_id && mission == of;
  }
};

struct ServerPulse {
  bool writable{true};
  std::string reason{};
  bool stalled{false};              ///< a write has been under way for seconds; reason says how long
  std::uint64_t disk_free_bytes{};  ///< 0: not known
  std::uint64_t queued_rows{};      ///< wait for the writer or for the live path
  std::string clock_skew{};         ///< the system clock against the receiver's, in words; empty: right
  std::string failed_tasks{};       ///< of the server, with what they threw; empty: none lately
  std::string not_started{};        ///< devices that are kept but do not run, and why; empty: all do
  std::string not_backed_up{};      ///< why the last backup failed; empty: it did not
  std::string unrecorded{};         ///< why raw bytes of the devices are not recorded; empty: they are
};

/// Every condition that holds (dashboard.md section 6, reliability.md section 2), of each flight its own: an
/// id at most once for each mission. Pure. Flights that are uploaded or replayed fast raise nothing. Silence
/// ends no alarm: one stands until measurements come, or the flight is finished.
std::vector<AlarmCondition> alarm_conditions(const std::vector<FlightPulse>& flights,
                                             const ServerPulse& server);

}  // namespace anchord::api
