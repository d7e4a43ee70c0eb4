#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

/// What lies where in a Pozyx tag. pozyx-serial.md sections 3 and 4; multi-byte values are little endian.
namespace anchord::pozyx {

namespace reg {
inline constexpr std::uint8_t who_am_i = 0x00, firmware = 0x01, hardware = 0x02, selftest = 0x03,
                              error_code = 0x04, int_status = 0x05, calib_status = 0x06, int_mask = 0x10,
                              pos_filter = 0x14, config_leds = 0x15, pos_alg = 0x16, pos_num_anchors = 0x17,
                              pos_interval = 0x18, network_id = 0x1a, uwb_channel = 0x1c, uwb_rates = 0x1d,
                              uwb_plen = 0x1e, uwb_gain = 0x1f, xtal_trim = 0x20, range_protocol = 0x21,
                              operation_mode = 0x22, sensors_mode = 0x23, pos_x = 0x30, pos_y = 0x34,
                              pos_z = 0x38, pos_err = 0x3c, sensors = 0x50, max_lin_acc = 0x4e, euler = 0x66,
                              temperature = 0x80, device_list_size = 0x81, rx_network_id = 0x82,
                              rx_data_len = 0x84, blink_index = 0x89;
}  // namespace reg

namespace fn {
inline constexpr std::uint8_t reset = 0xb0, led_ctrl = 0xb1, tx_data = 0xb2, tx_send = 0xb3, rx_data = 0xb4,
                              do_ranging = 0xb5, do_positioning = 0xb6, pos_set_anchor_ids = 0xb7,
                              pos_get_anchor_ids = 0xb8, flash_reset = 0xb9, flash_save = 0xba,
                              flash_details = 0xbb, do_aloha = 0xbc, devices_get_ids = 0xc0,
                              devices_discover = 0xc1, devices_calibrate = 0xc2, devices_clear = 0xc3,
                              device_add = 0xc4, device_get_info = 0xc5, device_get_coords = 0xc6,
                              device_get_range_info = 0xc7, cir_data = 0xc8, positioning_with_data = 0xcc;
}  // namespace fn

/// Bits of INT_STATUS (register 05). Reading it clears it.
namespace event {
inline constexpr std::uint8_t err = 0x01, pos = 0x02, imu = 0x04, rx_data = 0x08, func = 0x10;
}

/// Third parameter of TX_SEND.
namespace remote {
inline constexpr std::uint8_t read = 0x02, write = 0x04, data = 0x06, function = 0x08;
}

inline constexpr std::uint8_t k_who_am_i = 0x43;
inline constexpr std::size_t k_max_devices = 20;
inline constexpr std::size_t k_tx_buffer = 100;  ///< bytes of the radio message buffer
inline constexpr std::size_t k_max_cir_per_call = 49;

enum class Access : std::uint8_t { read, read_write };

struct Register {
  std::uint8_t address{};
  std::uint8_t bytes{};
  Access access{};
  std::string_view name;
};

/// Every register of the map, by rising address. The sensor block is one row per value. 24, 26 and 89 belong
/// to the blinking of newer firmware: only the maker's Python client names them.
inline constexpr std::array k_registers{Register{0x00, 1, Access::read, "WHO_AM_I"},
                                        Register{0x01, 1, Access::read, "FIRMWARE_VER"},
                                        Register{0x02, 1, Access::read, "HARDWARE_VER"},
                                        Register{0x03, 1, Access::read, "ST_RESULT"},
                                        Register{0x04, 1, Access::read, "ERRORCODE"},
                                        Register{0x05, 1, Access::read, "INT_STATUS"},
                                        Register{0x06, 1, Access::read, "CALIB_STATUS"},
                                        Register{0x10, 1, Access::read_write, "INT_MASK"},
                                        Register{0x11, 1, Access::read_write, "INT_CONFIG"},
                                        Register{0x14, 1, Access::read_write, "POS_FILTER"},
                                        Register{0x15, 1, Access::read_write, "CONFIG_LEDS"},
                                        Register{0x16, 1, Access::read_write, "POS_ALG"},
                                        Register{0x17, 1, Access::read_write, "POS_NUM_ANCHORS"},
                                        Register{0x18, 2, Access::read_write, "POS_INTERVAL"},
                                        Register{0x1a, 2, Access::read_write, "NETWORK_ID"},
                                        Register{0x1c, 1, Access::read_write, "UWB_CHANNEL"},
                                        Register{0x1d, 1, Access::read_write, "UWB_RATES"},
                                        Register{0x1e, 1, Access::read_write, "UWB_PLEN"},
                                        Register{0x1f, 1, Access::read_write, "UWB_GAIN"},
                                        Register{0x20, 1, Access::read_write, "UWB_XTALTRIM"},
                                        Register{0x21, 1, Access::read_write, "RANGE_PROTOCOL"},
                                        Register{0x22, 1, Access::read_write, "OPERATION_MODE"},
                                        Register{0x23, 1, Access::read_write, "SENSORS_MODE"},
                                        Register{0x24, 2, Access::read_write, "CONFIG_BLINK_PAYLOAD"},
                                        Register{0x26, 1, Access::read_write, "ALOHA_VARIATION"},
                                        Register{0x27, 1, Access::read_write, "CONFIG_GPIO1"},
                                        Register{0x28, 1, Access::read_write, "CONFIG_GPIO2"},
                                        Register{0x29, 1, Access::read_write, "CONFIG_GPIO3"},
                                        Register{0x2a, 1, Access::read_write, "CONFIG_GPIO4"},
                                        Register{0x30, 4, Access::read_write, "POS_X"},
                                        Register{0x34, 4, Access::read_write, "POS_Y"},
                                        Register{0x38, 4, Access::read_write, "POS_Z"},
                                        Register{0x3c, 2, Access::read, "POS_ERR_X"},
                                        Register{0x3e, 2, Access::read, "POS_ERR_Y"},
                                        Register{0x40, 2, Access::read, "POS_ERR_Z"},
                                        Register{0x42, 2, Access::read, "POS_ERR_XY"},
                                        Register{0x44, 2, Access::read, "POS_ERR_XZ"},
                                        Register{0x46, 2, Access::read, "POS_ERR_YZ"},
                                        Register{0x4e, 2, Access::read, "MAX_LIN_ACC"},
                                        Register{0x50, 4, Access::read, "PRESSURE"},
                                        Register{0x54, 6, Access::read, "ACCEL"},
                                        Register{0x5a, 6, Access::read, "MAGN"},
                                        Register{0x60, 6, Access::read, "GYRO"},
                                        Register{0x66, 6, Access::read, "EULER"},
                                        Register{0x6c, 8, Access::read, "QUATERNION"},
                                        Register{0x74, 6, Access::read, "LIN_ACC"},
                                        Register{0x7a, 6, Access::read, "GRAVITY"},
                                        Register{0x80, 1, Access::read, "TEMPERATURE"},
                                        Register{0x81, 1, Access::read, "DEVICE_LIST_SIZE"},
                                        Register{0x82, 2, Access::read, "RX_NETWORK_ID"},
                                        Register{0x84, 1, Access::read, "RX_DATA_LEN"},
                                        Register{0x85, 1, Access::read_write, "GPIO1"},
                                        Register{0x86, 1, Access::read_write, "GPIO2"},
                                        Register{0x87, 1, Access::read_write, "GPIO3"},
                                        Register{0x88, 1, Access::read_write, "GPIO4"},
                                        Register{0x89, 4, Access::read, "BLINK_INDEX"}};

/// The register that holds this address, if any.
constexpr const Register* register_at(std::uint8_t address) {
  for (const Register& row : k_registers) {
    if (address >= row.address && address < row.address + row.bytes) return &row;
  }
  return nullptr;
}

/// What register 04 says; "unknown" for codes without a meaning. Section 9.
std::string_view error_text(std::uint8_t code);

}  // namespace anchord::pozyx
