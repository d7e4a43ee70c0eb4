#include "drivers/drone/dialect.hpp"

#include <array>

#include "core/base/enum_table.hpp"

namespace anchord::drone {
namespace {

constexpr std::uint32_t px4(std::uint32_t main, std::uint32_t sub) { return main << 16U | sub << 24U; }

// ArduCopter mode.h Mode::Number; PX4 commander/px4_custom_mode.h. Hold is BRAKE for ArduPilot (stops at
// once) and AUTO/LOITER for PX4.
constexpr Dialect k_ardupilot{Autopilot::ardupilot, "ArduPilot", 4, 17, 6, 9, 4, false, true, false};
constexpr Dialect k_px4{Autopilot::px4, "PX4",     px4(4, 3), px4(4, 3), px4(4, 5),
                        px4(4, 6),      px4(4, 2), true,      false,     true};
constexpr Dialect k_unknown{Autopilot::unknown, "", 0, 0, 0, 0, 0, false, false, false};

constexpr auto k_ardupilot_modes = enum_table<std::uint32_t>({{"STABILIZE", 0},
                                                              {"ALT_HOLD", 2},
                                                              {"AUTO", 3},
                                                              {"GUIDED", 4},
                                                              {"LOITER", 5},
                                                              {"RTL", 6},
                                                              {"LAND", 9},
                                                              {"POSHOLD", 16},
                                                              {"BRAKE", 17},
                                                              {"GUIDED_NOGPS", 20},
                                                              {"SMART_RTL", 21},
                                                              {"AUTO_RTL", 27}});
constexpr auto k_px4_modes = enum_table<std::uint32_t>({{"MANUAL", px4(1, 0)},
                                                        {"ALTCTL", px4(2, 0)},
                                                        {"POSCTL", px4(3, 0)},
                                                        {"TAKEOFF", px4(4, 2)},
                                                        {"HOLD", px4(4, 3)},
                                                        {"MISSION", px4(4, 4)},
                                                        {"RTL", px4(4, 5)},
                                                        {"LAND", px4(4, 6)},
                                                        {"OFFBOARD", px4(6, 0)},
                                                        {"STABILIZED", px4(7, 0)}});

}  // namespace

const Dialect& dialect_of(Autopilot autopilot) {
  switch (autopilot) {
    case Autopilot::ardupilot:
      return k_ardupilot;
    case Autopilot::px4:
      return k_px4;
    case Autopilot::unknown:
      break;
  }
  return k_unknown;
}

Autopilot autopilot_of(std::int64_t heartbeat_autopilot) {
  if (heartbeat_autopilot == 3) return Autopilot::ardupilot;
  if (heartbeat_autopilot == 12) return Autopilot::px4;
  return Autopilot::unknown;
}

std::optional<int> stream_group(Autopilot autopilot, int message_id) {
  if (autopilot != Autopilot::ardupilot) return std::nullopt;  // PX4 knows no groups
  switch (message_id) {
    case 1:       // SYS_STATUS
    case 24:      // GPS_RAW_INT
      return 2;   // EXTENDED_STATUS
    case 33:      // GLOBAL_POSITION_INT
      return 6;   // POSITION
    case 147:     // BATTERY_STATUS
      return 12;  // EXTRA3
    default:
      return std::nullopt;
  }
}

std::string result_word(std::int64_t result) {
  constexpr std::array<std::string_view, 5> k_words{"accepted", "temporarily rejected", "denied",
                                                    "unsupported", "failed"};
  if (result >= 0 && result < static_cast<std::int64_t>(k_words.size()))
    return std::string(k_words[static_cast<std::size_t>(result)]);
  return "result " + std::to_string(result);
}

ModeKind mode_kind(Autopilot autopilot, std::uint32_t custom_mode) {
  const auto& d = dialect_of(autopilot);
  if (autopilot == Autopilot::unknown) return ModeKind::other;
  if (custom_mode == d.guided) return ModeKind::guided;
  if (custom_mode == d.hold) return ModeKind::hold;
  if (custom_mode == d.return_home) return ModeKind::return_home;
  if (custom_mode == d.land) return ModeKind::land;
  return ModeKind::other;
}

ModeParams mode_params(Autopilot autopilot, std::uint32_t custom_mode) {
  if (autopilot != Autopilot::px4) return {static_cast<double>(custom_mode), 0};
  return {static_cast<double>(custom_mode >> 16U & 0xFFU), static_cast<double>(custom_mode >> 24U)};
}

std::optional<std::uint32_t> mode_of(Autopilot autopilot, std::string_view wanted) {
  return autopilot == Autopilot::px4 ? k_px4_modes.find(wanted) : k_ardupilot_modes.find(wanted);
}

std::string_view mode_word(Autopilot autopilot, std::uint32_t custom_mode) {
  const auto find = [custom_mode](const auto& modes) -> std::string_view {
    for (const auto& [word, mode] : modes)
      if (mode == custom_mode) return word;
    return "other";  // a mode that the server never commands
  };
  return autopilot == Autopilot::px4 ? find(k_px4_modes) : find(k_ardupilot_modes);
}

}  // namespace anchord::drone
