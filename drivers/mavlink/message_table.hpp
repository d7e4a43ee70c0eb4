#pragma once

#include <array>
#include <cstdint>
#include <string_view>

namespace anchord::mavlink {

/// One row of the table of messages, as the sheet of the common set has it.
struct MessageRow {
  std::uint32_t id;
  std::string_view name;
  std::uint8_t crc_extra;
  /// Fields in wire order, "name:type" or "name:type[count]"; extensions (cut by older senders) after the
  /// bar.
  std::string_view layout;
};

/// Every message that anchord reads or sends: MAVLink common set, wire order (base fields by falling size of
/// their type). CRC_EXTRA is computed again from the names in message_test.cpp.
inline constexpr std::array<MessageRow, 51> k_messages{{
    {0, "HEARTBEAT", 50,
     "custom_mode:u32 type:u8 autopilot:u8 base_mode:u8 system_status:u8 mavlink_version:u8"},
    {1, "SYS_STATUS", 124,
     "onboard_control_sensors_present:u32 onboard_control_sensors_enabled:u32 "
     "onboard_control_sensors_health:u32 load:u16 voltage_battery:u16 current_battery:i16 "
     "drop_rate_comm:u16 errors_comm:u16 errors_count1:u16 errors_count2:u16 errors_count3:u16 "
     "errors_count4:u16 battery_remaining:i8 | onboard_control_sensors_present_extended:u32 "
     "onboard_control_sensors_enabled_extended:u32 onboard_control_sensors_health_extended:u32"},
    {2, "SYSTEM_TIME", 137, "time_unix_usec:u64 time_boot_ms:u32"},
    {4, "PING", 237, "time_usec:u64 seq:u32 target_system:u8 target_component:u8"},
    {11, "SET_MODE", 89, "custom_mode:u32 target_system:u8 base_mode:u8"},
    {20, "PARAM_REQUEST_READ", 214, "param_index:i16 target_system:u8 target_component:u8 param_id:c[16]"},
    {21, "PARAM_REQUEST_LIST", 159, "target_system:u8 target_component:u8"},
    {22, "PARAM_VALUE", 220, "param_value:f param_count:u16 param_index:u16 param_id:c[16] param_type:u8"},
    {23, "PARAM_SET", 168, "param_value:f target_system:u8 target_component:u8 param_id:c[16] param_type:u8"},
    {24, "GPS_RAW_INT", 24,
     "time_usec:u64 lat:i32 lon:i32 alt:i32 eph:u16 epv:u16 vel:u16 cog:u16 fix_type:u8 "
     "satellites_visible:u8 | alt_ellipsoid:i32 h_acc:u32 v_acc:u32 vel_acc:u32 hdg_acc:u32 "
     "yaw:u16"},
    {30, "ATTITUDE", 39, "time_boot_ms:u32 roll:f pitch:f yaw:f rollspeed:f pitchspeed:f yawspeed:f"},
    {32, "LOCAL_POSITION_NED", 185, "time_boot_ms:u32 x:f y:f z:f vx:f vy:f vz:f"},
    {33, "GLOBAL_POSITION_INT", 104,
     "time_boot_ms:u32 lat:i32 lon:i32 alt:i32 relative_alt:i32 vx:i16 vy:i16 vz:i16 hdg:u16"},
    {40, "MISSION_REQUEST", 230, "seq:u16 target_system:u8 target_component:u8 | mission_type:u8"},
    {41, "MISSION_SET_CURRENT", 28, "seq:u16 target_system:u8 target_component:u8"},
    {42, "MISSION_CURRENT", 28,
     "seq:u16 | total:u16 mission_state:u8 mission_mode:u8 mission_id:u32 fence_id:u32 "
     "rally_points_id:u32"},
    {43, "MISSION_REQUEST_LIST", 132, "target_system:u8 target_component:u8 | mission_type:u8"},
    {44, "MISSION_COUNT", 221,
     "count:u16 target_system:u8 target_component:u8 | mission_type:u8 opaque_id:u32"},
    {45, "MISSION_CLEAR_ALL", 232, "target_system:u8 target_component:u8 | mission_type:u8"},
    {46, "MISSION_ITEM_REACHED", 11, "seq:u16"},
    {47, "MISSION_ACK", 153, "target_system:u8 target_component:u8 type:u8 | mission_type:u8 opaque_id:u32"},
    {48, "SET_GPS_GLOBAL_ORIGIN", 41,
     "latitude:i32 longitude:i32 altitude:i32 target_system:u8 | time_usec:u64"},
    {49, "GPS_GLOBAL_ORIGIN", 39, "latitude:i32 longitude:i32 altitude:i32 | time_usec:u64"},
    {51, "MISSION_REQUEST_INT", 196, "seq:u16 target_system:u8 target_component:u8 | mission_type:u8"},
    {65, "RC_CHANNELS", 118,
     "time_boot_ms:u32 chan1_raw:u16 chan2_raw:u16 chan3_raw:u16 chan4_raw:u16 chan5_raw:u16 "
     "chan6_raw:u16 chan7_raw:u16 chan8_raw:u16 chan9_raw:u16 chan10_raw:u16 chan11_raw:u16 "
     "chan12_raw:u16 chan13_raw:u16 chan14_raw:u16 chan15_raw:u16 chan16_raw:u16 chan17_raw:u16 "
     "chan18_raw:u16 chancount:u8 rssi:u8"},
    {66, "REQUEST_DATA_STREAM", 148,
     "req_message_rate:u16 target_system:u8 target_component:u8 req_stream_id:u8 start_stop:u8"},
    {73, "MISSION_ITEM_INT", 38,
     "param1:f param2:f param3:f param4:f x:i32 y:i32 z:f seq:u16 command:u16 target_system:u8 "
     "target_component:u8 frame:u8 current:u8 autocontinue:u8 | mission_type:u8"},
    {74, "VFR_HUD", 20, "airspeed:f groundspeed:f alt:f climb:f heading:i16 throttle:u16"},
    {75, "COMMAND_INT", 158,
     "param1:f param2:f param3:f param4:f x:i32 y:i32 z:f command:u16 target_system:u8 "
     "target_component:u8 frame:u8 current:u8 autocontinue:u8"},
    {76, "COMMAND_LONG", 152,
     "param1:f param2:f param3:f param4:f param5:f param6:f param7:f command:u16 target_system:u8 "
     "target_component:u8 confirmation:u8"},
    {77, "COMMAND_ACK", 143,
     "command:u16 result:u8 | progress:u8 result_param2:i32 target_system:u8 target_component:u8"},
    {84, "SET_POSITION_TARGET_LOCAL_NED", 143,
     "time_boot_ms:u32 x:f y:f z:f vx:f vy:f vz:f afx:f afy:f afz:f yaw:f yaw_rate:f type_mask:u16 "
     "target_system:u8 target_component:u8 coordinate_frame:u8"},
    {85, "POSITION_TARGET_LOCAL_NED", 140,
     "time_boot_ms:u32 x:f y:f z:f vx:f vy:f vz:f afx:f afy:f afz:f yaw:f yaw_rate:f type_mask:u16 "
     "coordinate_frame:u8"},
    {86, "SET_POSITION_TARGET_GLOBAL_INT", 5,
     "time_boot_ms:u32 lat_int:i32 lon_int:i32 alt:f vx:f vy:f vz:f afx:f afy:f afz:f yaw:f "
     "yaw_rate:f type_mask:u16 target_system:u8 target_component:u8 coordinate_frame:u8"},
    {87, "POSITION_TARGET_GLOBAL_INT", 150,
     "time_boot_ms:u32 lat_int:i32 lon_int:i32 alt:f vx:f vy:f vz:f afx:f afy:f afz:f yaw:f "
     "yaw_rate:f type_mask:u16 coordinate_frame:u8"},
    {111, "TIMESYNC", 34, "tc1:i64 ts1:i64 | target_system:u8 target_component:u8"},
    {124, "GPS2_RAW", 87,
     "time_usec:u64 lat:i32 lon:i32 alt:i32 dgps_age:u32 eph:u16 epv:u16 vel:u16 cog:u16 "
     "fix_type:u8 satellites_visible:u8 dgps_numch:u8 | yaw:u16 alt_ellipsoid:i32 h_acc:u32 "
     "v_acc:u32 vel_acc:u32 hdg_acc:u32"},
    {127, "GPS_RTK", 25,
     "time_last_baseline_ms:u32 tow:u32 baseline_a_mm:i32 baseline_b_mm:i32 baseline_c_mm:i32 "
     "accuracy:u32 iar_num_hypotheses:i32 wn:u16 rtk_receiver_id:u8 rtk_health:u8 rtk_rate:u8 "
     "nsats:u8 baseline_coords_type:u8"},
    {128, "GPS2_RTK", 226,
     "time_last_baseline_ms:u32 tow:u32 baseline_a_mm:i32 baseline_b_mm:i32 baseline_c_mm:i32 "
     "accuracy:u32 iar_num_hypotheses:i32 wn:u16 rtk_receiver_id:u8 rtk_health:u8 rtk_rate:u8 "
     "nsats:u8 baseline_coords_type:u8"},
    {132, "DISTANCE_SENSOR", 85,
     "time_boot_ms:u32 min_distance:u16 max_distance:u16 current_distance:u16 type:u8 id:u8 "
     "orientation:u8 covariance:u8 | horizontal_fov:f vertical_fov:f quaternion:f[4] "
     "signal_quality:u8"},
    {147, "BATTERY_STATUS", 154,
     "current_consumed:i32 energy_consumed:i32 temperature:i16 voltages:u16[10] "
     "current_battery:i16 id:u8 battery_function:u8 type:u8 battery_remaining:i8 | "
     "time_remaining:i32 charge_state:u8 voltages_ext:u16[4] mode:u8 fault_bitmask:u32"},
    {148, "AUTOPILOT_VERSION", 178,
     "capabilities:u64 uid:u64 flight_sw_version:u32 middleware_sw_version:u32 os_sw_version:u32 "
     "board_version:u32 vendor_id:u16 product_id:u16 flight_custom_version:u8[8] "
     "middleware_custom_version:u8[8] os_custom_version:u8[8] | uid2:u8[18]"},
    {230, "ESTIMATOR_STATUS", 163,
     "time_usec:u64 vel_ratio:f pos_horiz_ratio:f pos_vert_ratio:f mag_ratio:f hagl_ratio:f "
     "tas_ratio:f pos_horiz_accuracy:f pos_vert_accuracy:f flags:u16"},
    {232, "GPS_INPUT", 151,
     "time_usec:u64 time_week_ms:u32 lat:i32 lon:i32 alt:f hdop:f vdop:f vn:f ve:f vd:f "
     "speed_accuracy:f horiz_accuracy:f vert_accuracy:f ignore_flags:u16 time_week:u16 gps_id:u8 "
     "fix_type:u8 satellites_visible:u8 | yaw:u16"},
    {233, "GPS_RTCM_DATA", 35, "flags:u8 len:u8 data:u8[180]"},
    {242, "HOME_POSITION", 104,
     "latitude:i32 longitude:i32 altitude:i32 x:f y:f z:f q:f[4] approach_x:f approach_y:f "
     "approach_z:f | time_usec:u64"},
    {244, "MESSAGE_INTERVAL", 95, "interval_us:i32 message_id:u16"},
    {245, "EXTENDED_SYS_STATE", 130, "vtol_state:u8 landed_state:u8"},
    {253, "STATUSTEXT", 83, "severity:u8 text:c[50] | id:u16 chunk_seq:u8"},
    {256, "SETUP_SIGNING", 71,
     "initial_timestamp:u64 target_system:u8 target_component:u8 secret_key:u8[32]"},
    {330, "OBSTACLE_DISTANCE", 23,
     "time_usec:u64 distances:u16[72] min_distance:u16 max_distance:u16 sensor_type:u8 "
     "increment:u8 | increment_f:f angle_offset:f frame:u8"},
}};

}  // namespace anchord::mavlink
