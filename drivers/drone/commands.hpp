#pragma once

/// MAV_CMD of MAVLink's common set.
namespace anchord::drone {

inline constexpr int k_take_off = 22, k_set_mode = 176, k_speed = 178, k_reposition = 192, k_arm = 400,
                     k_interval = 511;

}  // namespace anchord::drone
