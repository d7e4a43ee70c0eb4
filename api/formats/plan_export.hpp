#pragma once

#include <cstdint>
#include <string>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "core/types/plan.hpp"

namespace anchord::api {

/// Whose missions the items of a .plan are. PX4 flies headings with the waypoints and refuses a mission with
/// changes of yaw, so turns are left out; ArduPilot passes over the headings of waypoints and needs the
/// changes.
enum class Autopilot : std::uint8_t { ardupilot, px4 };
inline constexpr auto k_autopilot_words =
    enum_table<Autopilot>({{"ardupilot", Autopilot::ardupilot}, {"px4", Autopilot::px4}});

/// The plan as QGroundControl flies it: take-off, speed, waypoints with hold and heading, a turn where one is
/// to be made, return; the fence as inclusion polygon, outline and no-fly areas as exclusions. Altitudes
/// relative to home. errors  invalid_argument: a plan that is nowhere
Result<std::string> plan_qgc(const Plan& plan, Autopilot autopilot);
/// Waypoints, path, outline, fence and no-fly areas as features; read_geojson_plan() reads them again.
Result<std::string> plan_geojson(const Plan& plan);

}  // namespace anchord::api
