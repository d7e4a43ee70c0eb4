#include "drivers/sim/pozyx_sensors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace anchord::sim {

using namespace pozyx;

namespace {

// pozyx-serial.md section 8.
constexpr std::uint8_t k_accel = 0x54, k_magn = 0x5a, k_gyro = 0x60, k_quaternion = 0x6c, k_lin_acc = 0x74,
                       k_gravity = 0x7a;
constexpr double k_per_ut = 16, k_per_dps = 16, k_per_deg = 16, k_per_quaternion = 16384, k_g_mg = 1000;

/// Modes 1..7 are raw sensors, 8..12 fusions; mode 8 runs without the magnetometer.
struct On {
  bool acceleration, magnetometer, gyroscope, fusion;
};
constexpr std::array<On, 13> k_modes{{{false, false, false, false},
                                      {true, false, false, false},
                                      {false, true, false, false},
                                      {false, false, true, false},
                                      {true, true, false, false},
                                      {true, false, true, false},
                                      {false, true, true, false},
                                      {true, true, true, false},
                                      {true, false, true, true},
                                      {true, true, false, true},
                                      {true, true, false, true},
                                      {true, true, true, true},
                                      {true, true, true, true}}};

}  // namespace

void fill_sensors(PozyxDevice& device, const Pose& pose, double rate_radps) {
  const On on = k_modes[std::min<std::size_t>(device.register_value(reg::sensors_mode), k_modes.size() - 1)];
  const auto set = [&](bool is_on, std::uint8_t address, std::initializer_list<double> raw) {
    for (const double value : raw) {
      device.set_i16(address, is_on ? value : 0);
      address = static_cast<std::uint8_t>(address + 2);
    }
  };
  constexpr double k_turn = 2 * std::numbers::pi;
  double heading_rad = std::fmod(pose.heading_rad, k_turn);
  if (heading_rad < 0) heading_rad += k_turn;

  // Twelve pascals a metre near the ground, in mPa.
  Bytes pressure;
  put_u32(pressure, static_cast<std::uint32_t>(std::lround((101'325 - 12 * pose.enu_m.z()) * 1000)));
  device.set_bytes(reg::sensors, pressure);
  device.set_bytes(reg::temperature, Bytes{24});

  // Body axes forward, left, up; headings grow clockwise seen from above, rotations about up do not.
  set(on.acceleration, k_accel, {0, 0, k_g_mg});
  set(on.magnetometer, k_magn,
      {20 * k_per_ut * std::cos(heading_rad), 20 * k_per_ut * std::sin(heading_rad), -45 * k_per_ut});
  set(on.gyroscope, k_gyro, {0, 0, -rate_radps * 360 / k_turn * k_per_dps});
  set(on.fusion, reg::euler, {std::min(heading_rad / k_turn * 360 * k_per_deg, 5759.0), 0, 0});
  set(on.fusion, k_quaternion,
      {k_per_quaternion * std::cos(heading_rad / 2), 0, 0, -k_per_quaternion * std::sin(heading_rad / 2)});
  set(on.fusion, k_lin_acc, {0, 0, 0});
  set(on.fusion, k_gravity, {0, 0, k_g_mg});
}

}  // namespace anchord::sim
