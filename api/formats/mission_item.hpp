#pragma once

/// Numbers of items in a QGroundControl .plan: MAV_CMD and MAV_FRAME of the MAVLink common set.
namespace anchord::api::mission_item {

inline constexpr int k_waypoint = 16, k_return = 20, k_land = 21, k_takeoff = 22, k_yaw = 115;
/// MAV_CMD_NAV_FENCE_RETURN_POINT to .._CIRCLE_EXCLUSION: a fence among the items.
inline constexpr int k_fence_first = 5000, k_fence_last = 5004;
inline constexpr int k_frame_msl = 0, k_frame_mission = 2, k_frame_relative = 3;

}  // namespace anchord::api::mission_item
