// What it does when it is told to: the answers of ArduCopter and of PX4.
#include <cmath>
#include <numbers>

#include "drivers/sim/autopilot.hpp"

namespace anchord::sim {
namespace {

using mavlink::Message;

constexpr int k_accepted = 0, k_rejected_now = 1, k_denied = 2, k_unsupported = 3, k_failed = 4;

}  // namespace

void AutopilotSim::handle(const Message& m, mavlink::Address from) {
  const auto& d = drone::dialect_of(options_.dialect);
  if (m.is("HEARTBEAT")) {
    station_s_ = now_s_;
    failsafe_ = false;  // the mode that it changed into stays
  } else if (m.is("COMMAND_LONG") || m.is("COMMAND_INT")) {
    const int result = run_command(m);
    if (random_.chance(options_.ack_loss)) return;
    send(Message("COMMAND_ACK")
             .set("command", m.integer("command"))
             .set("result", result)
             .set("target_system", from.system)
             .set("target_component", from.component),
         options_.ack_delay_s);
  } else if (m.is("SET_POSITION_TARGET_GLOBAL_INT")) {
    // Outside GUIDED targets are ignored in silence, as ArduPilot does.
    if (options_.does_nothing || custom_mode_ != d.guided || options_.dialect == drone::Autopilot::px4 ||
        m.integer("coordinate_frame") != 6)
      return;
    const bool with_yaw = (m.integer("type_mask") & 1024) == 0;
    target(m.real("lat_int") * 1e-7, m.real("lon_int") * 1e-7, m.real("alt"),
           with_yaw ? std::optional(m.real("yaw")) : std::nullopt);
  } else if (m.is("PARAM_REQUEST_READ")) {
    parameter(m);
  } else if (m.is("REQUEST_DATA_STREAM")) {
    set_group(m);
  } else {
    lists(m, from);
  }
}

void AutopilotSim::target(double lat_deg, double lon_deg, double above_home_m,
                          std::optional<double> heading_rad) {
  if (!vehicle_.in_air()) return;
  Eigen::Vector3d to = metres(lat_deg, lon_deg);
  to.z() = home_m_.z() + above_home_m;
  aim_m_ = to;
  if (heading_rad) heading_ = heading_rad;
}

Eigen::Vector3d AutopilotSim::asked_m(const Message& m) const {
  const bool command = m.is("COMMAND_INT");
  const double home_msl = options_.origin.height_m + home_m_.z() - options_.geoid_m;
  Eigen::Vector3d to =
      metres(m.real(command ? "x" : "lat_int") * 1e-7, m.real(command ? "y" : "lon_int") * 1e-7);
  to.z() = home_m_.z() + (command ? m.real("z") - home_msl : m.real("alt"));
  return to - error_m();
}

std::string AutopilotSim::not_ready() const {
  if (now_s_ - boot_s_ < options_.ready_s) return "Need Position Estimate";
  return refusal_;
}

/// RTL, LAND and BRAKE do not allow arming (Mode::allows_arming).
bool AutopilotSim::armable() const {
  const auto& d = drone::dialect_of(options_.dialect);
  return custom_mode_ == d.guided ||
         (custom_mode_ != d.return_home && custom_mode_ != d.land && custom_mode_ != d.hold);
}

int AutopilotSim::arm(bool on) {
  const bool px4 = options_.dialect == drone::Autopilot::px4;
  if (!on) {
    vehicle_.disarm();  // in the air only by force
    return !vehicle_.armed() ? k_accepted : px4 ? k_denied : k_failed;
  }
  if (vehicle_.armed()) return k_accepted;
  const std::string why = !armable() ? "Mode not armable" : not_ready();
  if (!why.empty()) {
    if (px4) text(2, "Arming denied: Resolve system health failures first");
    text(2, (px4 ? "Preflight Fail: " : "Arm: ") + why);
    return px4 ? k_rejected_now : k_failed;
  }
  vehicle_.arm();
  armed_s_ = now_s_;
  home_m_ = believed_m();  // home is where it was armed
  return k_accepted;
}

int AutopilotSim::take_off(double param7) {
  const auto& d = drone::dialect_of(options_.dialect);
  if (!vehicle_.armed() || vehicle_.in_air()) return k_failed;
  if (!d.take_off_above_sea && custom_mode_ != d.guided) return k_failed;
  const double home_msl = options_.origin.height_m + home_m_.z() - options_.geoid_m;
  const double above_home_m = d.take_off_above_sea ? param7 - home_msl : param7;
  if (!(above_home_m > 0)) return k_denied;
  vehicle_.take_off(1);
  vehicle_.set_speed(options_.cruise_mps);
  aim_m_ = believed_m();
  aim_m_->z() = home_m_.z() + above_home_m;
  if (d.take_off_above_sea) {
    custom_mode_ = d.climbing;
    mode_s_ = now_s_;
  }
  return k_accepted;
}

int AutopilotSim::reposition(const Message& m) {
  const auto& d = drone::dialect_of(options_.dialect);
  if (!m.is("COMMAND_INT") || m.integer("frame") != 5) return k_denied;
  if (!vehicle_.in_air()) return k_rejected_now;
  if (m.integer("param2") == 1) set_mode(d.guided);
  if (custom_mode_ != d.guided) return k_accepted;  // and flown to by nobody: that is the navigator's Loiter
  const double home_msl = options_.origin.height_m + home_m_.z() - options_.geoid_m;
  const double yaw = m.real("param4"), speed = m.real("param1");
  if (speed > 0) vehicle_.set_speed(speed);
  target(m.real("x") * 1e-7, m.real("y") * 1e-7, m.real("z") - home_msl,
         std::isnan(yaw) ? std::nullopt : std::optional(yaw));
  return k_accepted;
}

/// Groups of ArduCopter's GCS_MAVLink: EXTENDED_STATUS, POSITION, EXTRA3.
void AutopilotSim::set_group(const Message& m) {
  if (options_.dialect == drone::Autopilot::px4 || m.integer("req_message_rate") <= 0) return;
  const auto group = m.integer("req_stream_id");
  const std::vector<int> ids = group == 2    ? std::vector<int>{1, 24}
                               : group == 6  ? std::vector<int>{33}
                               : group == 12 ? std::vector<int>{147}
                                             : std::vector<int>{};
  for (const int id : ids) {
    intervals_[id] = m.integer("start_stop") == 1 ? 1 / m.real("req_message_rate") : 0;
    next_s_[id] = now_s_;
  }
}

int AutopilotSim::set_interval(const Message& m) {
  if (options_.old_streams) return k_unsupported;
  const int id = static_cast<int>(m.integer("param1"));
  const bool heartbeat_of_px4 = id == 0 && options_.dialect == drone::Autopilot::px4;
  if (!heartbeat_of_px4) {
    intervals_[id] = m.real("param2") * 1e-6;
    next_s_[id] = now_s_;
  }
  return k_accepted;
}

int AutopilotSim::run_command(const Message& m) {
  const bool px4 = options_.dialect == drone::Autopilot::px4;
  if (options_.does_nothing && m.integer("command") != 511) return k_accepted;
  switch (m.integer("command")) {
    case 176:  // DO_SET_MODE
      set_mode(px4 ? static_cast<std::uint32_t>(m.integer("param2")) << 16U |
                         static_cast<std::uint32_t>(m.integer("param3")) << 24U
                   : static_cast<std::uint32_t>(m.integer("param2")));
      return k_accepted;
    case 178:  // DO_CHANGE_SPEED
      if (m.real("param2") > 0) vehicle_.set_speed(m.real("param2"));
      return k_accepted;
    case 400:
      return arm(m.real("param1") > 0.5);
    case 22:
      return m.is("COMMAND_LONG") ? take_off(m.real("param7")) : k_denied;
    case 192:
      return reposition(m);
    case 511:
      return set_interval(m);
    case 512:
      return k_accepted;
    default:
      return k_unsupported;
  }
}

}  // namespace anchord::sim
