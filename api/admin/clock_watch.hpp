#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "core/base/steady.hpp"
#include "core/base/time.hpp"

namespace anchord::api {

/// Notices when somebody sets the system clock: it moved by 2 s or more against the steady one between two
/// looks. Slewing (NTP, at most 0.5 ms a second) is none. Not thread-safe.
class ClockWatch {
 public:
  static constexpr double k_step_s = 2;
  static constexpr double k_stands_s = 600;  ///< how long the alarm stands after the last step
  /// Call it about once a second. What the alarm says while it stands; empty: no step of late.
  std::string look(UtcTime wall, SteadyTime steady);

 private:
  std::optional<UtcTime> wall_{};
  SteadyTime steady_{};
  std::optional<SteadyTime> stepped_{};
  std::string text_;
};

}  // namespace anchord::api
