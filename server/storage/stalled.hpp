#pragma once

#include <string>
#include <string_view>

#include "server/storage/sqlite_database.hpp"

namespace anchord::sql {

/// A commit takes milliseconds; below this a busy disk would be an alarm.
inline constexpr double k_stalled_s = 3;

/// Nothing fails while a disk or a server hangs, so that only the wait tells: the same limit whatever has the
/// rows.
/// oldest_s  how long the write that waits longest has waited
/// cause     what may be the matter, for the operator
inline bool note_stall(double oldest_s, std::string_view cause, StorageHealth& health) {
  if (oldest_s <= k_stalled_s) return false;
  health.level = StorageLevel::stalled;
  health.reason = "the database has not taken a write for " + std::to_string(static_cast<int>(oldest_s)) +
                  " s: " + std::string(cause);
  return true;
}

}  // namespace anchord::sql
