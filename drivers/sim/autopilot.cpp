// Time, bytes, flying, and what happens to it.
#include "drivers/sim/autopilot.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "drivers/sim/wgs84.hpp"

namespace anchord::sim {
namespace {

using mavlink::Message;

constexpr double k_step_s = 0.05, k_metres_per_degree = 111'195;
constexpr double k_disarm_delay_s = 10;  ///< ArduCopter DISARM_DELAY; PX4 COM_DISARM_PRFLT
constexpr double k_return_above_home_m = 4;

}  // namespace

AutopilotSim::AutopilotSim(AutopilotOptions options)
    : options_(std::move(options)),
      vehicle_(options_.vehicle, options_.home_m, 0),
      packer_({1, 1}),
      random_(options_.seed),
      home_m_(options_.home_m + options_.gnss_offset_m) {
  if (options_.secret) {
    const auto now = mavlink::signature_time(options_.start_unix_us);
    packer_.sign_with(*options_.secret, 1, now);
    framer_.require_signature(*options_.secret, now);
  }
  if (options_.dialect == drone::Autopilot::px4)
    parameters_ = {
        {"NAV_DLL_ACT", {2, true}},     {"COM_DL_LOSS_T", {options_.link_loss_s.value_or(10), true}},
        {"COM_LOW_BAT_ACT", {3, true}}, {"NAV_RCL_ACT", {2, true}},
        {"GF_ACTION", {2, true}},       {"MPC_XY_CRUISE", {5, false}},
        {"EKF2_HGT_REF", {1, true}},    {"COM_OBL_RC_ACT", {0, true}}};
  else
    parameters_ = {
        {"FS_GCS_ENABLE", {1, true}},   {"FS_GCS_TIMEOUT", {options_.link_loss_s.value_or(5), false}},
        {"BATT_FS_LOW_ACT", {2, true}}, {"FS_THR_ENABLE", {1, true}},
        {"FENCE_ENABLE", {1, true}},    {"FENCE_ACTION", {1, true}},
        {"WPNAV_SPEED", {800, false}},  {"EK3_SRC1_POSXY", {3, true}},
        {"EK3_SRC1_POSZ", {1, true}},   {"SYSID_MYGCS", {255, true}},
        {"FS_EKF_ACTION", {1, true}}};
  restart();
}

/// Of a site's size a sphere's tangent would do; the height is exact at the origin.
Wgs84 AutopilotSim::place(const Eigen::Vector3d& enu_m) const {
  return wgs84_from_enu(options_.origin, enu_m);
}

Eigen::Vector3d AutopilotSim::metres(double lat_deg, double lon_deg) const {
  // Newton on the forward formula: two rounds are below a millimetre within a kilometre.
  Eigen::Vector3d enu{0, 0, 0};
  for (int i = 0; i < 3; ++i) {
    const Wgs84 at = place(enu);
    enu.y() += (lat_deg - at.lat_deg) * k_metres_per_degree;
    enu.x() += std::remainder(lon_deg - at.lon_deg, 360) * k_metres_per_degree *
               std::cos(lat_deg * std::numbers::pi / 180);
  }
  return enu;
}

Eigen::Vector3d AutopilotSim::error_m() const {
  Eigen::Vector3d out = options_.gnss_offset_m;
  out.z() += std::clamp(options_.baro_drift_mps * airborne_s_, -options_.baro_drift_max_m,
                        options_.baro_drift_max_m);
  return out;
}

std::optional<Eigen::Vector3d> AutopilotSim::aim_m() const {
  if (!aim_m_) return std::nullopt;
  return Eigen::Vector3d(*aim_m_ - error_m());
}

void AutopilotSim::send(const Message& m, double delay_s) {
  const auto bytes = packer_.pack(m);
  const bool lost = random_.chance(options_.loss), twice = random_.chance(options_.duplicate);
  if (lost || silent_ || now_s_ < std::max(boot_s_, silent_until_s_)) return;
  for (int i = 0; i < (twice ? 2 : 1); ++i) out_.push_back({now_s_ + options_.latency_s + delay_s, bytes});
}

void AutopilotSim::text(int severity, const std::string& words) {
  Message m("STATUSTEXT");
  m.set("severity", severity).set_text("text", words);
  send(m);
}

std::vector<std::uint8_t> AutopilotSim::take_bytes() {
  std::vector<std::uint8_t> out;
  for (auto it = out_.begin(); it != out_.end();) {
    if (it->due_s > now_s_ + 1e-9) {
      ++it;
      continue;
    }
    out.insert(out.end(), it->bytes.begin(), it->bytes.end());
    it = out_.erase(it);
  }
  return out;
}

void AutopilotSim::feed(std::span<const std::uint8_t> bytes) {
  if (bytes.empty()) return;
  if (options_.latency_s <= 0) return receive(bytes);
  in_.push_back({now_s_ + options_.latency_s, {bytes.begin(), bytes.end()}});
}

void AutopilotSim::receive(std::span<const std::uint8_t> bytes) {
  std::vector<mavlink::Received> in;
  framer_.feed(bytes, in);
  for (const auto& one : in) {
    const bool lost = random_.chance(options_.loss_in);
    if (!lost && !silent_ && now_s_ >= std::max(boot_s_, silent_until_s_)) handle(one.message, one.from);
  }
}

void AutopilotSim::set_mode(std::uint32_t custom_mode) {
  const auto& d = drone::dialect_of(options_.dialect);
  if (custom_mode == custom_mode_) return;  // as Copter::set_mode: nothing begins anew
  mode_s_ = now_s_;
  custom_mode_ = custom_mode;
  returning_ = false;
  heading_.reset();
  if (!vehicle_.in_air()) return;
  vehicle_.set_speed(options_.cruise_mps);  // each mode begins with the autopilot's own speed
  if (custom_mode == d.land) {
    aim_m_.reset();
    vehicle_.land();
  } else if (custom_mode == d.return_home) {
    returning_ = true;
    aim_m_ = home_m_;
    aim_m_->z() = std::max(believed_m().z(), home_m_.z() + k_return_above_home_m);
  } else if (custom_mode != d.climbing || d.climbing == d.guided) {
    aim_m_ = believed_m();
  }
}

void AutopilotSim::pilot_takes_over(std::uint32_t custom_mode) { set_mode(custom_mode); }

void AutopilotSim::pilot_lands() {
  set_mode(options_.dialect == drone::Autopilot::px4 ? 3U << 16U : 5U);  // POSCTL, LOITER
  aim_m_.reset();
  vehicle_.land();
}

/// The modes that autopilots change into by themselves.
void AutopilotSim::fail(Failsafe failsafe) {
  const auto& d = drone::dialect_of(options_.dialect);
  if (!vehicle_.in_air()) return;
  failsafe_ = true;
  const bool lands =
      failsafe == Failsafe::ekf || (failsafe == Failsafe::battery && vehicle_.battery() < 0.05);
  set_mode(lands ? d.land : d.return_home);
  text(2, failsafe == Failsafe::radio     ? "Radio Failsafe"
          : failsafe == Failsafe::battery ? "Battery Failsafe"
          : failsafe == Failsafe::ekf     ? "EKF Failsafe"
                                          : "GCS Failsafe");
}

/// Telemetry that was asked for is forgotten, the heartbeat is all that comes; lists and parameters stay.
bool AutopilotSim::restart() {
  if (vehicle_.in_air()) return false;
  vehicle_.disarm();
  const bool px4 = options_.dialect == drone::Autopilot::px4;
  boot_s_ = now_s_ > 0 ? now_s_ + 2 : 0;
  intervals_ = {{0, 1.0}};
  next_s_.clear();
  custom_mode_ = shown_mode_ = px4 ? 3U << 16U : 0U;  // POSCTL, STABILIZE
  station_s_.reset();
  armed_s_.reset();
  failsafe_ = ready_told_ = returning_ = false;
  aim_m_.reset();
  uploading_ = -1;
  prearm_told_s_ = -100;
  home_m_ = believed_m();
  return true;
}

void AutopilotSim::refuse_arming(const std::string& why) {
  refusal_ = why;
  prearm_told_s_ = -100;
}

void AutopilotSim::watch_failsafes() {
  const auto& d = drone::dialect_of(options_.dialect);
  const bool busy = failsafe_ || custom_mode_ == d.land || custom_mode_ == d.return_home;
  const bool px4 = options_.dialect == drone::Autopilot::px4;
  const bool enabled = parameters_[px4 ? "NAV_DLL_ACT" : "FS_GCS_ENABLE"].value > 0;
  const double patience_s = parameters_[px4 ? "COM_DL_LOSS_T" : "FS_GCS_TIMEOUT"].value;
  if (enabled && station_s_ && now_s_ - *station_s_ > patience_s && vehicle_.in_air() && !busy)
    fail(Failsafe::station);
  if (options_.battery_failsafe && vehicle_.in_air() && custom_mode_ != d.land) {
    if (vehicle_.battery() < 0.05 || (vehicle_.battery() < 0.15 && !busy)) fail(Failsafe::battery);
  }
}

void AutopilotSim::fly(double seconds) {
  const auto& d = drone::dialect_of(options_.dialect);
  const bool was_in_air = vehicle_.in_air();
  if (was_in_air) airborne_s_ += seconds;
  if (vehicle_.in_air() && aim_m_) vehicle_.go_to(*aim_m_ - error_m(), heading_);
  vehicle_.advance(seconds);
  if (vehicle_.in_air() && aim_m_ && (believed_m() - *aim_m_).norm() < 1.0) {
    if (returning_) {  // lands without leaving its mode
      vehicle_.land_at((*aim_m_ - error_m()).head<2>());
      aim_m_.reset();
    } else if (d.climbing != d.guided && custom_mode_ == d.climbing) {
      custom_mode_ = d.guided;  // PX4: AUTO_TAKEOFF ends in AUTO_LOITER
      mode_s_ = now_s_;
    }
  }
  if (was_in_air && !vehicle_.in_air()) aim_m_.reset();
  if (!vehicle_.armed()) armed_s_.reset();
  const bool stands = vehicle_.armed() && !vehicle_.in_air();
  const bool ends = custom_mode_ == d.land || custom_mode_ == d.return_home;
  if (stands && armed_s_ && now_s_ - *armed_s_ > (ends ? 1 : k_disarm_delay_s)) vehicle_.disarm();
}

void AutopilotSim::advance(double now_s) {
  while (now_s_ + k_step_s <= now_s + 1e-9) {
    fly(k_step_s);
    now_s_ += k_step_s;
    const auto stamp =
        mavlink::signature_time(options_.start_unix_us + static_cast<std::int64_t>(now_s_ * 1e6));
    packer_.set_time(stamp);
    framer_.set_time(stamp);
    while (!in_.empty() && in_.front().due_s <= now_s_ + 1e-9) {
      const auto bytes = std::move(in_.front().bytes);
      in_.pop_front();
      receive(bytes);
    }
    watch_failsafes();
    if (now_s_ - mode_s_ >= options_.mode_lag_s) shown_mode_ = custom_mode_;
    telemetry();
  }
}

}  // namespace anchord::sim
