#pragma once

/// Numbers of items in a QGroundControl .plan: MAV_CMD and MAV_FRAME of the MAVLink common set.
namespace anchord::api::mission_item {

inline constexpr int k_waypoint = 16, k_loiter_time = 19, k_return = 20, k_land = 21, k_takeoff = 22,
                     k_spline = 82, k_delay = 93, k_yaw = 115, k_speed = 178;
inline constexpr int k_last_flown = 95;  ///< MAV_CMD_NAV_LAST: up to it a command flies somewhere
/// MAV_CMD_NAV_FENCE_RETURN_POINT to .._CIRCLE_EXCLUSION: a fence among the items.
inline constexpr int k_fence_first = 5000, k_fence_last = 5004;
inline constexpr int k_frame_msl = 0, k_frame_mission = 2, k_frame_relative = 3;

}  // namespace anchord::api::mission_item
