#include "drivers/drone/telemetry.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

namespace anchord::drone {
namespace {

using mavlink::Message;

constexpr double k_ask_again_s = 3, k_stale_s = 5, k_answer_s = 0.6, k_pace_s = 0.1;
constexpr int k_tries = 5, k_armed = 0x80, k_on_ground = 1;
constexpr std::int64_t k_prearm_bit = 0x10000000;  // MAV_SYS_STATUS_PREARM_CHECK
constexpr double k_highest_m = 100'000;            ///< INT32_MIN and INT32_MAX mm say that there is no height

/// None: an estimator without an origin says 0, 0; what has no place on earth is nobody's.
std::optional<Wgs84> place_of(const Message& m) {
  const Wgs84 at{m.real("lat") * 1e-7, m.real("lon") * 1e-7, m.real("alt") * 1e-3};
  const bool nowhere = (at.lat_deg == 0 && at.lon_deg == 0) || std::abs(at.lat_deg) > 90 ||
                       std::abs(at.lon_deg) > 180 || std::abs(at.height_m) > k_highest_m ||
                       std::abs(m.real("relative_alt") * 1e-3) > k_highest_m;
  return nowhere ? std::nullopt : std::optional(at);
}

}  // namespace

// HEARTBEAT more often than once a second shows a pilot's mode sooner; PX4 keeps its own pace.
Telemetry::Telemetry()
    : streams_{{{33, "GLOBAL_POSITION_INT", 0.1, true},
                {245, "EXTENDED_SYS_STATE", 0.5, true},
                {1, "SYS_STATUS", 1, true},
                {24, "GPS_RAW_INT", 0.2, true},
                {0, "HEARTBEAT", 0.2, false},
                {242, "HOME_POSITION", 1, false},
                {147, "BATTERY_STATUS", 1, false}}} {}

bool Telemetry::fresh(std::string_view stream, double now_s, double within_s) const {
  const auto it =
      std::find_if(streams_.begin(), streams_.end(), [&](const Stream& s) { return s.name == stream; });
  return it != streams_.end() && now_s - it->last_seen_s <= within_s;
}

bool Telemetry::in_air(double now_s) const {
  if (!status_.armed) return false;
  return !fresh("EXTENDED_SYS_STATE", now_s, k_ask_again_s) || landed_ != k_on_ground;
}

std::optional<double> Telemetry::home_msl_m() const {
  // Of one message: home moves when the autopilot arms, and HOME_POSITION comes later.
  if (status_.position && status_.relative_m) return status_.position->height_m - *status_.relative_m;
  return status_.home ? std::optional(status_.home->height_m) : std::nullopt;
}

void Telemetry::restarted() {
  ++restarts_;
  for (auto& s : streams_) {
    s.last_seen_s = s.asked_s = -1e9;
    s.asked = 0;
    s.result = 0;
    s.by_group = false;
  }
  for (auto& [name, p] : parameters_) p = {};
  status_.home.reset();
  status_.battery.reset();
  status_.battery_v.reset();
  status_.ready_to_arm.reset();
  status_.not_ready.clear();
  status_.text.clear();
  warning_.clear();
  status_.battery_warning = 0;
  landed_ = 0;
  position_s_ = battery_s_ = warning_s_ = -1e9;
}

void Telemetry::receive_status_text(const Message& m, double now_s) {
  status_.text = m.text("text");
  if (m.integer("severity") > 4) return;  // MAV_SEVERITY_WARNING and worse
  warning_ = status_.text;
  warning_s_ = now_s;
  // ArduPilot's words; PX4 says "Preflight Fail: ..." and "Arming denied: ...".
  for (const std::string_view begin : {"PreArm: ", "Preflight Fail: ", "Arming denied"}) {
    if (warning_.rfind(begin, 0) == 0) status_.not_ready = warning_;
  }
}

void Telemetry::receive_battery(const Message& m, double now_s) {
  if (const auto left = m.integer("battery_remaining"); left >= 0) {
    status_.battery = static_cast<double>(left) / 100;
    battery_s_ = now_s;
  }
  if (m.is("SYS_STATUS")) {
    // 0 and UINT16_MAX: not measured.
    if (const auto mv = m.integer("voltage_battery"); mv > 0 && mv < 65535)
      status_.battery_v = m.real("voltage_battery") / 1000;
    const bool told = (m.integer("onboard_control_sensors_present") & k_prearm_bit) != 0;
    status_.ready_to_arm =
        told ? std::optional((m.integer("onboard_control_sensors_health") & k_prearm_bit) != 0)
             : std::nullopt;
    if (status_.ready_to_arm.value_or(true)) status_.not_ready.clear();
    return;
  }
  // MAV_BATTERY_CHARGE_STATE: 2 low; 3 critical, 4 emergency, 5 failed, 6 unhealthy.
  const auto state = m.integer("charge_state");
  status_.battery_warning = state >= 3 && state <= 6 ? 2 : state == 2 ? 1 : 0;
}

void Telemetry::receive_position(const Message& m, double now_s) {
  const auto boot_ms = m.integer("time_boot_ms");
  const auto place = place_of(m);
  twins_.position(now_s, boot_ms, place);
  if (boot_ms + 1000 < boot_ms_ && !twins_.two(now_s)) {
    restarted();
    streams_[0].last_seen_s = now_s;
  }
  boot_ms_ = boot_ms;
  // UINT16_MAX: not known; hundredths of a degree.
  const auto heading = m.integer("hdg");
  status_.heading_deg = heading <= 36'000 ? std::optional(m.real("hdg") / 100) : std::nullopt;
  if (!place) return;
  status_.position = place;
  status_.relative_m = m.real("relative_alt") * 1e-3;
  status_.speed_mps = std::hypot(m.real("vx"), m.real("vy"), m.real("vz")) / 100;
  position_s_ = now_s;
}

void Telemetry::receive_parameter(const Message& m, Autopilot autopilot) {
  const auto it = parameters_.find(m.text("param_id"));
  if (it == parameters_.end()) return;
  const auto value = static_cast<float>(m.real("param_value"));
  const auto type = m.integer("param_type");
  // PX4 puts the bits of an integer into the float, ArduPilot its value. 6: MAV_PARAM_TYPE_INT32.
  it->second.value = autopilot == Autopilot::px4 && type == 6 ? std::bit_cast<std::int32_t>(value)
                                                              : static_cast<double>(value);
}

void Telemetry::receive(const Message& m, Autopilot autopilot, double now_s) {
  if (!first_s_) first_s_ = now_s;
  for (auto& s : streams_) {
    if (static_cast<int>(m.id()) == s.id) {
      s.last_seen_s = now_s;
      s.asked = 0;
      s.result = 0;
    }
  }
  if (m.is("HEARTBEAT")) {
    status_.armed = (m.integer("base_mode") & k_armed) != 0;
    status_.failsafe = m.integer("system_status") >= 5;  // MAV_STATE_CRITICAL
    twins_.heartbeat(now_s, status_.armed);
  } else if (m.is("GLOBAL_POSITION_INT")) {
    receive_position(m, now_s);
  } else if (m.is("GPS_RAW_INT")) {
    status_.gps_fix = static_cast<int>(m.integer("fix_type"));
  } else if (m.is("SYS_STATUS") || m.is("BATTERY_STATUS")) {
    receive_battery(m, now_s);
  } else if (m.is("HOME_POSITION")) {
    status_.home = Wgs84{m.real("latitude") * 1e-7, m.real("longitude") * 1e-7, m.real("altitude") * 1e-3};
  } else if (m.is("EXTENDED_SYS_STATE")) {
    landed_ = m.integer("landed_state");
  } else if (m.is("STATUSTEXT")) {
    receive_status_text(m, now_s);
  } else if (m.is("PARAM_VALUE")) {
    receive_parameter(m, autopilot);
  }
}

void Telemetry::ask_parameters(const std::vector<std::string>& names) {
  for (const auto& name : names) parameters_.try_emplace(name);
}

void Telemetry::answer(std::int64_t result) {
  if (open_) streams_[*open_].result = result;
  open_.reset();
}

std::optional<Message> Telemetry::question(Autopilot autopilot, double now_s) {
  if (open_ && now_s - question_s_ < k_answer_s) return std::nullopt;
  open_.reset();
  if (now_s - question_s_ < k_pace_s) return std::nullopt;
  for (std::size_t i = 0; i < streams_.size(); ++i) {
    auto& s = streams_[i];
    const bool never = s.asked_s < -1e8;  // it may come by itself, more slowly
    // A refusal is answered at once, by the group if there is one.
    const auto group = s.result != 0 ? stream_group(autopilot, s.id) : std::nullopt;
    const bool now = group && !std::exchange(s.by_group, group.has_value());
    // What it does not have is not asked for for ever at the same pace.
    const double patience_s = s.asked < k_tries ? 2 : 10;
    const bool comes = !never && now_s - s.last_seen_s <= k_ask_again_s;
    if (comes || (!now && now_s - s.asked_s < patience_s)) continue;
    s.asked_s = question_s_ = now_s;
    ++s.asked;
    if (group) {
      Message m("REQUEST_DATA_STREAM");
      m.set("req_stream_id", *group).set("start_stop", 1);
      m.set("req_message_rate", std::max(1L, std::lround(1 / s.interval_s)));
      return m;
    }
    open_ = i;
    Message m("COMMAND_LONG");
    m.set("command", 511).set("param1", s.id).set_real("param2", s.interval_s * 1e6);
    return m;
  }
  for (auto& [name, p] : parameters_) {
    if (p.value || now_s - p.asked_s < (p.asked < k_tries ? 1 : 30)) continue;
    p.asked_s = question_s_ = now_s;
    ++p.asked;
    Message m("PARAM_REQUEST_READ");
    m.set("param_index", -1).set_text("param_id", name);
    return m;
  }
  return std::nullopt;
}

void Telemetry::fill(DroneStatus& out, double now_s) const {
  out = status_;
  out.in_air = in_air(now_s);
  const auto age = [&](double since_s) {
    return since_s < -1e8 ? std::numeric_limits<double>::infinity() : now_s - since_s;
  };
  out.position_age_s = age(position_s_);
  out.battery_age_s = age(battery_s_);
  for (const auto& s : streams_) {
    const double since_s = std::max(s.last_seen_s, first_s_.value_or(now_s));
    const double place_s = std::max(position_s_, first_s_.value_or(now_s));
    if (s.watched && now_s - since_s > k_stale_s)
      out.stale.emplace_back(s.name);
    else if (&s == &streams_[0] && now_s - place_s > k_stale_s)
      out.stale.push_back(std::string(s.name) + " (it comes, and says no place)");
    if (s.result != 0) out.streams_refused.push_back(std::string(s.name) + ": " + result_word(s.result));
  }
  for (const auto& [name, p] : parameters_) {
    if (p.value)
      out.parameters[name] = *p.value;
    else if (p.asked >= k_tries)
      out.parameters_unknown.push_back(name);
  }
}

}  // namespace anchord::drone
