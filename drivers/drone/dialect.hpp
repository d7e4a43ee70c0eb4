#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "core/ports/drone.hpp"

namespace anchord::drone {

enum class Autopilot : std::uint8_t { unknown, ardupilot, px4 };

/// Everything in which ArduPilot Copter and PX4 differ, in one place.
struct Dialect {
  Autopilot autopilot{};
  std::string_view name;
  /// custom_mode of HEARTBEAT for the modes that we command.
  std::uint32_t guided{}, hold{}, return_home{}, land{};
  std::uint32_t climbing{};   ///< shown while it takes off: PX4's own mode for it
  bool take_off_above_sea{};  ///< param7 of TAKEOFF: above mean sea level (PX4) or above home (ArduPilot)
  bool home_is_item_0{};      ///< of a mission list: a place for home comes first (ArduPilot)
  bool targets_by_command{};  ///< go-to by DO_REPOSITION (PX4 in hold) or by position targets (ArduPilot)
};
const Dialect& dialect_of(Autopilot autopilot);
/// By the autopilot number of HEARTBEAT: 3 ArduPilot, 12 PX4.
Autopilot autopilot_of(std::int64_t heartbeat_autopilot);

/// MAV_DATA_STREAM group in which that message comes by REQUEST_DATA_STREAM, for an autopilot that refuses
/// SET_MESSAGE_INTERVAL (ArduPilot before 4.0); none: it comes in no group.
std::optional<int> stream_group(Autopilot autopilot, int message_id);
/// Word of MAV_RESULT.
std::string result_word(std::int64_t result);

/// Parameters 2 and 3 of DO_SET_MODE.
struct ModeParams {
  double main{}, sub{};
};
ModeKind mode_kind(Autopilot autopilot, std::uint32_t custom_mode);
ModeParams mode_params(Autopilot autopilot, std::uint32_t custom_mode);
/// The mode of that word; none: there is no such mode.
std::optional<std::uint32_t> mode_of(Autopilot autopilot, std::string_view word);
std::string_view mode_word(Autopilot autopilot, std::uint32_t custom_mode);

}  // namespace anchord::drone
