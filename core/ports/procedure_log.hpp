#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// Topic of the plan as it is flown, from its start or a change on.
inline constexpr const char* k_log_plan = "plan";

/// One message of a flight as it was shown: of topic procedure, mission.grid, mission.turn or mission.height,
/// or k_log_plan.
struct ProcedureEntry {
  UtcTime time{};
  std::string topic;
  std::string message_json;
};

/// What the procedure of a flight showed, and when: a replay shows the same again. Append-only; it goes with
/// its mission. Callable from any thread; errors as in measurement_store.hpp.
class ProcedureLog {
 public:
  /// A page ends behind the entry that exceeds it: one with hundreds of candidates has some 100 kB.
  static constexpr std::size_t k_page_bytes = 4 << 20;
  struct Numbered {
    std::uint64_t number{};  ///< from 1, in the order of appending
    ProcedureEntry entry;
  };

  virtual ~ProcedureLog() = default;
  /// In this order, all or none; nothing where the mission is gone.
  virtual Result<void> append(const MissionId& mission, std::span<const ProcedureEntry> entries) = 0;
  /// The first ones behind `after` (0: from the start), at most `limit`.
  virtual Result<std::vector<Numbered>> entries(const MissionId& mission, std::size_t limit,
                                                std::uint64_t after) = 0;
};

}  // namespace anchord
