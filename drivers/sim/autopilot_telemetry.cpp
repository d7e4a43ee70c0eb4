// What it says: the streams that were asked for, its texts, its parameters.
#include <bit>
#include <cmath>
#include <numbers>

#include "drivers/sim/autopilot.hpp"

namespace anchord::sim {
namespace {

using mavlink::Message;

constexpr std::int64_t k_prearm_bit = 0x10000000;  // MAV_SYS_STATUS_PREARM_CHECK
constexpr double k_prearm_again_s = 30;

std::int64_t e7(double deg) { return static_cast<std::int64_t>(std::llround(deg * 1e7)); }

}  // namespace

Message AutopilotSim::telemetry_message(int id) const {
  const Eigen::Vector3d at = believed_m(), v = vehicle_.velocity_mps() * 100;
  const Wgs84 here = place(at), home = place(home_m_);
  const auto ms = static_cast<std::int64_t>((now_s_ - boot_s_) * 1000);
  const bool armed = vehicle_.armed(), ready = not_ready().empty();
  switch (id) {
    case 0:
      return Message("HEARTBEAT")
          .set("type", 2)
          .set("autopilot", options_.dialect == drone::Autopilot::px4 ? 12 : 3)
          .set("base_mode", armed ? 0x89 : 0x09)
          .set("custom_mode", shown_mode_)
          .set("system_status", failsafe_           ? 5
                                : vehicle_.in_air() ? 4
                                                    : 3)
          .set("mavlink_version", 3);
    case 33:
      return Message("GLOBAL_POSITION_INT")
          .set("time_boot_ms", ms)
          .set("lat", options_.no_place ? 0 : e7(here.lat_deg))
          .set("lon", options_.no_place ? 0 : e7(here.lon_deg))
          .set("alt", std::llround((here.height_m - options_.geoid_m) * 1000))
          .set("relative_alt", std::llround((at.z() - home_m_.z()) * 1000))
          .set("vx", std::llround(v.y()))
          .set("vy", std::llround(v.x()))
          .set("vz", std::llround(-v.z()))
          .set("hdg", std::llround(vehicle_.heading_rad() * 18'000 / std::numbers::pi) % 36'000);
    case 24:
      return Message("GPS_RAW_INT")
          .set("time_usec", ms * 1000)
          .set("fix_type", 6)
          .set("lat", e7(here.lat_deg))
          .set("lon", e7(here.lon_deg))
          .set("satellites_visible", 19);
    case 1:
      return Message("SYS_STATUS")
          .set("onboard_control_sensors_present", k_prearm_bit)
          .set("onboard_control_sensors_enabled", k_prearm_bit)
          .set("onboard_control_sensors_health", ready ? k_prearm_bit : 0)
          .set("battery_remaining", std::llround(vehicle_.battery() * 100))
          .set("voltage_battery", std::llround(13'200 + 3'600 * vehicle_.battery() - 1'000 * options_.sag_v));
    case 147:
      return Message("BATTERY_STATUS")
          .set("battery_remaining", std::llround(vehicle_.battery() * 100))
          .set("charge_state", charge_state_);
    case 242:
      return Message("HOME_POSITION")
          .set("latitude", e7(home.lat_deg))
          .set("longitude", e7(home.lon_deg))
          .set("altitude", std::llround((home.height_m - options_.geoid_m) * 1000));
    default:
      return Message("EXTENDED_SYS_STATE").set("landed_state", vehicle_.in_air() ? 2 : 1);
  }
}

void AutopilotSim::telemetry() {
  for (const auto& [id, interval_s] : intervals_) {
    double& next_s = next_s_[id];
    if (!(interval_s > 0) || now_s_ + 1e-9 < next_s) continue;
    next_s = std::max(next_s + interval_s, now_s_);
    const bool known = id == 0 || id == 1 || id == 24 || id == 33 || id == 147 || id == 242 || id == 245;
    if (known) send(telemetry_message(id));
  }
  if (now_s_ < boot_s_) return;
  const auto why = not_ready();
  if (why.empty() && !ready_told_) {
    ready_told_ = true;
    text(6, "EKF3 IMU0 is using GPS");
  }
  if (why.empty() || vehicle_.armed() || now_s_ - prearm_told_s_ < k_prearm_again_s) return;
  prearm_told_s_ = now_s_;
  text(2, (options_.dialect == drone::Autopilot::px4 ? "Preflight Fail: " : "PreArm: ") + why);
}

void AutopilotSim::parameter(const Message& m) {
  const auto it = parameters_.find(m.text("param_id"));
  if (it == parameters_.end()) return;
  const auto& p = it->second;
  const bool bits = p.whole && options_.dialect == drone::Autopilot::px4;
  Message out("PARAM_VALUE");
  out.set_text("param_id", it->first).set("param_type", p.whole ? 6 : 9);  // INT32, REAL32
  out.set("param_count", static_cast<std::int64_t>(parameters_.size()));
  out.set_real("param_value", bits ? std::bit_cast<float>(static_cast<std::int32_t>(p.value)) : p.value);
  send(out);
}

}  // namespace anchord::sim
