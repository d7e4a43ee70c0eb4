#include "drivers/sim/autopilot.hpp"

#include <cmath>
#include <numbers>
#include <utility>

#include "drivers/sim/wgs84.hpp"

namespace anchord::sim {
namespace {

using mavlink::Message;

constexpr int k_accepted = 0, k_rejected_now = 1, k_denied = 2, k_unsupported = 3, k_failed = 4;
constexpr double k_step_s = 0.05;
constexpr double k_metres_per_degree = 111'195;

}  // namespace

AutopilotSim::AutopilotSim(AutopilotOptions options)
    : options_(std::move(options)),
      vehicle_(options_.vehicle, options_.home_m, 0),
      packer_({1, 1}),
      random_(options_.seed) {
  if (options_.secret) {
    const auto now = mavlink::signature_time(options_.start_unix_us);
    packer_.sign_with(*options_.secret, 1, now);
    framer_.require_signature(*options_.secret, now);
  }
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
    enu.x() += (lon_deg - at.lon_deg) * k_metres_per_degree * std::cos(lat_deg * std::numbers::pi / 180);
  }
  return enu;
}

void AutopilotSim::send(const Message& m) {
  const auto bytes = packer_.pack(m);
  const bool lost = random_.chance(options_.loss), twice = random_.chance(options_.duplicate);
  if (lost || silent_) return;
  for (int i = 0; i < (twice ? 2 : 1); ++i) out_.insert(out_.end(), bytes.begin(), bytes.end());
}

void AutopilotSim::text(int severity, const std::string& words) {
  Message m("STATUSTEXT");
  m.set("severity", severity).set_text("text", words);
  send(m);
}

std::vector<std::uint8_t> AutopilotSim::take_bytes() { return std::exchange(out_, {}); }

void AutopilotSim::feed(std::span<const std::uint8_t> bytes) {
  std::vector<mavlink::Received> in;
  framer_.feed(bytes, in);
  if (silent_) return;
  for (const auto& one : in) handle(one.message, one.from);
}

void AutopilotSim::handle(const Message& m, mavlink::Address from) {
  const auto& dialect = drone::dialect_of(options_.dialect);
  if (m.is("HEARTBEAT")) {
    station_s_ = now_s_;
    failsafe_ = false;
  } else if (m.is("COMMAND_LONG") || m.is("COMMAND_INT")) {
    const int result = run_command(m);
    send(Message("COMMAND_ACK").set("command", m.integer("command")).set("result", result));
  } else if (m.is("SET_POSITION_TARGET_GLOBAL_INT")) {
    // Outside GUIDED targets are ignored in silence, as ArduPilot does.
    if (custom_mode_ != dialect.guided || m.integer("coordinate_frame") != 6) return;
    const bool with_yaw = (m.integer("type_mask") & 1024) == 0;
    target(m.real("lat_int") * 1e-7, m.real("lon_int") * 1e-7, m.real("alt"),
           with_yaw ? std::optional(m.real("yaw")) : std::nullopt);
  } else {
    lists(m, from);
  }
}

void AutopilotSim::target(double lat_deg, double lon_deg, double height_m,
                          std::optional<double> heading_rad) {
  Eigen::Vector3d to = metres(lat_deg, lon_deg);
  to.z() = options_.home_m.z() + height_m;
  vehicle_.go_to(to, heading_rad);
}

bool AutopilotSim::set_mode(std::uint32_t custom_mode) {
  const auto& dialect = drone::dialect_of(options_.dialect);
  custom_mode_ = custom_mode;
  if (custom_mode == dialect.land)
    vehicle_.land();
  else if (custom_mode == dialect.return_home)
    vehicle_.return_home();
  else if (custom_mode == dialect.hold || custom_mode != dialect.guided)
    vehicle_.hold();
  return true;
}

int AutopilotSim::arm(bool on) {
  if (!on) {
    vehicle_.disarm();
    return vehicle_.armed() ? k_failed : k_accepted;
  }
  if (now_s_ < options_.ready_s) {
    text(2, "Arm: Need Position Estimate");
    return k_failed;
  }
  vehicle_.arm();
  return k_accepted;
}

int AutopilotSim::take_off(double param7) {
  const auto& dialect = drone::dialect_of(options_.dialect);
  if (!vehicle_.armed()) return k_failed;
  if (!dialect.take_off_above_sea && custom_mode_ != dialect.guided) return k_failed;
  const double home_msl = options_.origin.height_m + options_.home_m.z() - options_.geoid_m;
  const double height = dialect.take_off_above_sea ? param7 - home_msl : param7;
  if (!(height > 0)) return k_denied;
  vehicle_.take_off(height);
  return k_accepted;
}

int AutopilotSim::run_command(const Message& m) {
  switch (m.integer("command")) {
    case 176:  // DO_SET_MODE
      if (options_.dialect == drone::Autopilot::px4) {
        set_mode(static_cast<std::uint32_t>(m.integer("param2")) << 16U |
                 static_cast<std::uint32_t>(m.integer("param3")) << 24U);
      } else {
        set_mode(static_cast<std::uint32_t>(m.integer("param2")));
      }
      return k_accepted;
    case 400:
      return arm(m.real("param1") > 0.5);
    case 22:
      return m.is("COMMAND_LONG") ? take_off(m.real("param7")) : k_denied;
    case 192: {  // DO_REPOSITION
      if (!m.is("COMMAND_INT") || m.integer("frame") != 5) return k_denied;
      const double home_msl = options_.origin.height_m + options_.home_m.z() - options_.geoid_m;
      const double yaw = m.real("param4");
      target(m.real("x") * 1e-7, m.real("y") * 1e-7, m.real("z") - home_msl,
             std::isnan(yaw) ? std::nullopt : std::optional(yaw));
      return k_accepted;
    }
    case 511:
    case 512:
      return k_accepted;
    default:
      return k_unsupported;
  }
}

void AutopilotSim::lists(const Message& m, mavlink::Address from) {
  const auto list_of = [&]() -> std::vector<Message>& {
    return m.integer("mission_type") == 1 ? fence_ : mission_;
  };
  const auto to = [&](Message out) {
    out.set("target_system", from.system).set("target_component", from.component);
    out.set("mission_type", m.integer("mission_type"));
    send(out);
  };
  if (m.integer("mission_type") == 1 && !options_.keeps_fences) {
    to(Message("MISSION_ACK").set("type", 3));  // unsupported
  } else if (m.is("MISSION_COUNT")) {
    list_of().clear();
    wanted_ = static_cast<std::size_t>(m.integer("count"));
    uploading_ = static_cast<int>(m.integer("mission_type"));
    to(wanted_ == 0 ? Message("MISSION_ACK") : Message("MISSION_REQUEST_INT").set("seq", 0));
  } else if (m.is("MISSION_ITEM_INT") && uploading_ == m.integer("mission_type")) {
    auto& list = list_of();
    if (m.integer("seq") != static_cast<std::int64_t>(list.size())) return;
    list.push_back(m);
    const bool last = list.size() == wanted_;
    to(last ? Message("MISSION_ACK")
            : Message("MISSION_REQUEST_INT").set("seq", static_cast<std::int64_t>(list.size())));
    if (last) uploading_ = -1;
  } else if (m.is("MISSION_REQUEST_LIST")) {
    to(Message("MISSION_COUNT").set("count", static_cast<std::int64_t>(list_of().size())));
  } else if (m.is("MISSION_REQUEST_INT")) {
    const auto seq = static_cast<std::size_t>(m.integer("seq"));
    if (seq < list_of().size()) to(list_of()[seq]);
  }
}

void AutopilotSim::telemetry() {
  const auto& dialect = drone::dialect_of(options_.dialect);
  const Eigen::Vector3d at = vehicle_.position_m(), v = vehicle_.velocity_mps() * 100;
  const Wgs84 place_now = place(at), home = place(options_.home_m);
  const auto e7 = [](double deg) { return static_cast<std::int64_t>(std::llround(deg * 1e7)); };
  const auto ms = static_cast<std::int64_t>(now_s_ * 1000);
  if (now_s_ - sent_fast_s_ >= 0.0999) {
    sent_fast_s_ = now_s_;
    send(Message("GLOBAL_POSITION_INT")
             .set("time_boot_ms", ms)
             .set("lat", e7(place_now.lat_deg))
             .set("lon", e7(place_now.lon_deg))
             .set("alt", std::llround((place_now.height_m - options_.geoid_m) * 1000))
             .set("relative_alt", std::llround((at.z() - options_.home_m.z()) * 1000))
             .set("vx", std::llround(v.y()))
             .set("vy", std::llround(v.x()))
             .set("vz", std::llround(-v.z()))
             .set("hdg", std::llround(vehicle_.heading_rad() * 18'000 / std::numbers::pi) % 36'000));
    send(Message("GPS_RAW_INT")
             .set("time_usec", ms * 1000)
             .set("fix_type", 6)
             .set("lat", e7(place_now.lat_deg))
             .set("lon", e7(place_now.lon_deg))
             .set("satellites_visible", 19));
  }
  if (now_s_ - sent_slow_s_ >= 0.9999) {
    sent_slow_s_ = now_s_;
    const bool armed = vehicle_.armed();
    send(Message("HEARTBEAT")
             .set("type", 2)
             .set("autopilot", dialect.autopilot == drone::Autopilot::px4 ? 12 : 3)
             .set("base_mode", armed ? 0x89 : 0x09)
             .set("custom_mode", custom_mode_)
             .set("system_status", failsafe_ ? 5
                                   : armed   ? 4
                                             : 3)
             .set("mavlink_version", 3));
    send(Message("SYS_STATUS")
             .set("battery_remaining", std::llround(vehicle_.battery() * 100))
             .set("voltage_battery", 15'800));
    send(Message("HOME_POSITION")
             .set("latitude", e7(home.lat_deg))
             .set("longitude", e7(home.lon_deg))
             .set("altitude", std::llround((home.height_m - options_.geoid_m) * 1000)));
    send(Message("EXTENDED_SYS_STATE").set("landed_state", vehicle_.in_air() ? 2 : 1));
    if (!ready_told_ && now_s_ >= options_.ready_s) {
      ready_told_ = true;
      text(6, "EKF3 IMU0 is using GPS");
    }
  }
}

void AutopilotSim::advance(double now_s) {
  while (now_s_ + k_step_s <= now_s + 1e-9) {
    vehicle_.advance(k_step_s);
    now_s_ += k_step_s;
    const auto stamp =
        mavlink::signature_time(options_.start_unix_us + static_cast<std::int64_t>(now_s_ * 1e6));
    packer_.set_time(stamp);
    framer_.set_time(stamp);
    const bool alone = station_s_ && now_s_ - *station_s_ > options_.link_loss_s;
    if (alone && vehicle_.in_air() && !failsafe_ && vehicle_.mode() != Vehicle::Mode::land) {
      failsafe_ = true;
      set_mode(drone::dialect_of(options_.dialect).return_home);
      text(3, "GCS Failsafe");
    }
    telemetry();
  }
}

}  // namespace anchord::sim
