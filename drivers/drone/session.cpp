#include "drivers/drone/session.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace anchord::drone {
namespace {

using mavlink::Message;

// MAV_CMD of the common set.
constexpr int k_return = 20, k_land = 21, k_take_off = 22, k_set_mode = 176, k_reposition = 192, k_arm = 400,
              k_interval = 511;
constexpr double k_degree = std::numbers::pi / 180,
                 k_metres_per_degree = 111'195;  // mean earth radius 6371 km
constexpr int k_armed = 0x80;
constexpr double k_vehicle_kept_s = 10;

std::string result_word(std::int64_t result) {
  switch (result) {
    case 0:
      return "accepted";
    case 1:
      return "temporarily rejected";
    case 2:
      return "denied";
    case 3:
      return "unsupported";
    case 4:
      return "failed";
    default:
      return "result " + std::to_string(result);
  }
}

}  // namespace

Session::Session(SessionOptions options) : options_(options), packer_(options.self) {
  if (options_.secret) {
    packer_.sign_with(*options_.secret, 0, 0);
    framer_.require_signature(*options_.secret, 0);
  }
}

void Session::send(const Message& message) {
  const auto bytes = packer_.pack(message);
  out_.insert(out_.end(), bytes.begin(), bytes.end());
}

std::vector<std::uint8_t> Session::take_bytes() { return std::exchange(out_, {}); }
std::vector<CommandReport> Session::take_reports() { return std::exchange(reports_, {}); }

void Session::report(std::uint64_t number, const std::string& what, CommandState state, std::string text) {
  reports_.push_back({number, what, state, std::move(text)});
}

Message Session::addressed(std::string_view name) const {
  Message m(name);
  m.set("target_system", vehicle_.system).set("target_component", vehicle_.component);
  return m;
}

void Session::feed(double now_s, std::int64_t unix_us, std::span<const std::uint8_t> bytes) {
  now_s_ = now_s;
  framer_.set_time(mavlink::signature_time(unix_us));
  std::vector<mavlink::Received> in;
  framer_.feed(bytes, in);
  packer_.set_time(framer_.newest_signature());  // the autopilot refuses stamps behind its own
  for (const auto& one : in) handle(one);
}

/// Nothing of one aircraft is another's.
void Session::forget_vehicle() {
  heard_s_.reset();
  vehicle_ = {0, 0};
  autopilot_ = Autopilot::unknown;
  status_ = {};
  custom_mode_ = 0;
  commanded_mode_.reset();
  commanded_s_.reset();
  home_msl_m_.reset();
  refusal_.clear();
  take_off_.reset();
  target_.reset();
  pending_.clear();
  if (transfer_) end_transfer(CommandState::unconfirmed, "the aircraft on the link is another one");
  transfer_.reset();
  rates_s_ = -100;
}


void Session::handle(const mavlink::Received& in) {
  const auto& m = in.message;
  if (m.is("HEARTBEAT")) return on_heartbeat(in);
  if (in.from != vehicle_) return;
  if (m.is("GLOBAL_POSITION_INT")) {
    const double lat = m.real("lat") * 1e-7, lon = m.real("lon") * 1e-7;
    if (lat != 0 || lon != 0) status_.position = Wgs84{lat, lon, m.real("alt") * 1e-3};
    status_.relative_m = m.real("relative_alt") * 1e-3;
    status_.speed_mps = std::hypot(m.real("vx"), m.real("vy"), m.real("vz")) / 100;
    if (m.integer("hdg") != 65535) status_.heading_deg = m.real("hdg") / 100;
  } else if (m.is("GPS_RAW_INT")) {
    status_.gps_fix = static_cast<int>(m.integer("fix_type"));
  } else if (m.is("SYS_STATUS")) {
    if (const auto left = m.integer("battery_remaining"); left >= 0)
      status_.battery = static_cast<double>(left) / 100;
  } else if (m.is("BATTERY_STATUS")) {
    if (const auto left = m.integer("battery_remaining"); left >= 0)
      status_.battery = static_cast<double>(left) / 100;
  } else if (m.is("HOME_POSITION")) {
    status_.home = Wgs84{m.real("latitude") * 1e-7, m.real("longitude") * 1e-7, m.real("altitude") * 1e-3};
    home_msl_m_ = status_.home->height_m;
  } else if (m.is("EXTENDED_SYS_STATE")) {
    const auto landed = m.integer("landed_state");
    if (landed != 0) status_.in_air = landed != 1;
  } else if (m.is("STATUSTEXT")) {
    status_.text = m.text("text");
    if (m.integer("severity") <= 4) refusal_ = status_.text;
  } else if (m.is("COMMAND_ACK")) {
    on_ack(m);
  } else {
    on_transfer(m);
  }
}

void Session::on_heartbeat(const mavlink::Received& in) {
  const auto& m = in.message;
  if (m.integer("autopilot") == 8 || m.integer("type") == 6) return;  // another station
  if (heard_s_ && in.from != vehicle_) {
    // One vehicle a session: the first heard, until it is silent for long and was not armed.
    if (now_s_ - *heard_s_ <= k_vehicle_kept_s || status_.armed) return;
    forget_vehicle();
  }
  vehicle_ = in.from;
  autopilot_ = autopilot_of(m.integer("autopilot"));
  heard_s_ = now_s_;
  status_.armed = (m.integer("base_mode") & k_armed) != 0;
  status_.failsafe = m.integer("system_status") >= 5;
  if (!status_.armed) status_.in_air = false;
  const auto mode = static_cast<std::uint32_t>(m.integer("custom_mode"));
  if (mode != custom_mode_) {
    // A change that we did not command, while we command: the pilot, or a failsafe.
    const bool ours =
        commanded_mode_ && (mode == *commanded_mode_ || (commanded_s_ && now_s_ - *commanded_s_ < 3));
    // PX4 lands by itself at the end of its return.
    const auto& dialect = dialect_of(autopilot_);
    const bool return_ends = commanded_mode_ == dialect.return_home && mode == dialect.land;
    if (commanded_mode_ && !ours && !return_ends && (target_ || take_off_ || status_.in_air)) {
      status_.taken_over = true;
      target_.reset();
      take_off_.reset();
    }
    custom_mode_ = mode;
  }
  status_.mode = std::string(mode_word(autopilot_, mode));
}

void Session::ask_rates() {
  if (now_s_ - rates_s_ < 5 || (status_.position && status_.home && rates_s_ > 0)) return;
  rates_s_ = now_s_;
  // GLOBAL_POSITION_INT and GPS_RAW_INT at 10 Hz, the rest at 1 Hz.
  for (const auto& [id, interval_us] : {std::pair{33, 1e5}, {24, 1e5}, {1, 1e6}, {242, 1e6}, {245, 1e6}}) {
    Message m = addressed("COMMAND_LONG");
    m.set("command", k_interval).set("param1", id).set_real("param2", interval_us);
    send(m);
  }
}

void Session::command(std::uint64_t number, const std::string& what, int command_number,
                      std::initializer_list<double> params) {
  Message m = addressed("COMMAND_LONG");
  m.set("command", command_number);
  int i = 1;
  for (const double p : params) m.set_real("param" + std::to_string(i++), p);
  // One of a kind at a time: a newer one takes the place of the older.
  std::erase_if(pending_, [&](const Pending& p) { return p.command == command_number; });
  send(m);
  pending_.push_back({number, what, std::move(m), command_number, now_s_, now_s_, 1});
}

/// A mode number means nothing before it is known whose it is.
bool Session::deaf(std::uint64_t number, const std::string& what) {
  if (heard_s_ && autopilot_ != Autopilot::unknown) return false;
  report(number, what, CommandState::refused,
         heard_s_ ? "neither ArduPilot nor PX4" : "the aircraft has not been heard");
  return true;
}

std::uint64_t Session::mode(const std::string& what, std::uint32_t Dialect::*wanted) {
  const std::uint64_t number = ++number_;
  if (deaf(number, what)) return number;
  const std::uint32_t custom_mode = dialect_of(autopilot_).*wanted;
  target_.reset();
  take_off_.reset();
  commanded_mode_ = custom_mode;
  commanded_s_ = now_s_;
  const auto params = mode_params(autopilot_, custom_mode);
  command(number, what, k_set_mode, {1, params.main, params.sub});
  report(number, what, CommandState::sent, "");
  return number;
}

std::uint64_t Session::hold() { return mode("hold", &Dialect::hold); }
std::uint64_t Session::return_home() { return mode("return_home", &Dialect::return_home); }
std::uint64_t Session::land() { return mode("land", &Dialect::land); }

std::uint64_t Session::take_off(double height_m) {
  const std::uint64_t number = ++number_;
  if (deaf(number, "take_off")) return number;
  status_.taken_over = false;
  report(number, "take_off", CommandState::sent, "");
  if (!(height_m > 0 && height_m <= 120)) {
    report(number, "take_off", CommandState::refused, "the height must be above 0 and at most 120 m");
    return number;
  }
  take_off_ = TakeOff{number, height_m, now_s_, -10, TakeOff::Stage::mode};
  drive_take_off();
  return number;
}

void Session::drive_take_off() {
  if (!take_off_) return;
  auto& t = *take_off_;
  const auto& dialect = dialect_of(autopilot_);
  if (now_s_ - t.begun_s > options_.arm_s) {
    report(t.number, "take_off", CommandState::unconfirmed, "not in the air in time: " + refusal_);
    take_off_.reset();
    return;
  }
  using Stage = TakeOff::Stage;
  if (t.stage == Stage::mode && (custom_mode_ == dialect.guided || dialect.take_off_above_sea))
    t.stage = Stage::arm, t.tried_s = -10;
  if (t.stage == Stage::arm && status_.armed) t.stage = Stage::climb, t.tried_s = -10;
  if (t.stage == Stage::climb && (status_.in_air || status_.relative_m.value_or(0) > 0.5)) {
    report(t.number, "take_off", CommandState::accepted, "in the air");
    take_off_.reset();
    return;
  }
  if (now_s_ - t.tried_s < 2) return;
  t.tried_s = now_s_;
  commanded_mode_ = dialect.guided;
  commanded_s_ = now_s_;
  if (t.stage == Stage::mode) {
    const auto params = mode_params(autopilot_, dialect.guided);
    command(t.number, "mode", k_set_mode, {1, params.main, params.sub});
  } else if (t.stage == Stage::arm) {
    command(t.number, "arm", k_arm, {1, 0});
  } else {
    const double nan = std::nan("");
    const double height = t.height_m + (dialect.take_off_above_sea ? home_msl_m_.value_or(0) : 0);
    if (dialect.take_off_above_sea)
      command(t.number, "climb", k_take_off, {0, 0, 0, nan, nan, nan, height});
    else
      command(t.number, "climb", k_take_off, {0, 0, 0, 0, 0, 0, height});
  }
}

double Session::distance_m(double lat_deg, double lon_deg, double height_m) const {
  if (!status_.position) return 0;
  const double north = (lat_deg - status_.position->lat_deg) * k_metres_per_degree;
  const double east =
      (lon_deg - status_.position->lon_deg) * k_metres_per_degree * std::cos(lat_deg * k_degree);
  return std::hypot(north, east, height_m - status_.relative_m.value_or(height_m));
}

std::uint64_t Session::go_to(double lat_deg, double lon_deg, double height_m,
                             std::optional<double> heading_deg) {
  const std::uint64_t number = ++number_;
  report(number, "go_to", CommandState::sent, "");
  const auto refuse = [&](std::string text) {
    report(number, "go_to", CommandState::refused, std::move(text));
    return number;
  };
  // The last gate, behind the guard of the procedure.
  if (!std::isfinite(lat_deg) || !std::isfinite(lon_deg) || !std::isfinite(height_m) ||
      std::abs(lat_deg) > 90 || std::abs(lon_deg) > 180 || (lat_deg == 0 && lon_deg == 0)) {
    return refuse("the target is no place");
  }
  if (!status_.position) return refuse("the autopilot has not told where it is");
  if (status_.taken_over) return refuse("the pilot or a failsafe has taken over: " + status_.mode);
  if (const double m = distance_m(lat_deg, lon_deg, height_m); m > options_.max_jump_m) {
    return refuse("the target is " + std::to_string(std::lround(m)) + " m away");
  }
  const auto& dialect = dialect_of(autopilot_);
  const auto as_int = [](double deg) { return static_cast<std::int64_t>(std::llround(deg * 1e7)); };
  commanded_mode_ = dialect.guided;
  if (dialect.targets_by_command) {
    Message m = addressed("COMMAND_INT");
    m.set("command", k_reposition).set("frame", 5).set("param1", -1).set("param2", 1);
    m.set_real("param4", heading_deg ? *heading_deg * k_degree : std::nan(""));
    m.set("x", as_int(lat_deg)).set("y", as_int(lon_deg));
    m.set_real("z", height_m + home_msl_m_.value_or(0));
    commanded_s_ = now_s_;
    std::erase_if(pending_, [](const Pending& p) { return p.command == k_reposition; });
    send(m);
    pending_.push_back({number, "go_to", std::move(m), k_reposition, now_s_, now_s_, 1});
    return number;
  }
  Message m = addressed("SET_POSITION_TARGET_GLOBAL_INT");
  // Position alone (0xDF8) or with yaw (0x9F8), frame 6: relative to home.
  m.set("type_mask", heading_deg ? 0x9F8 : 0xDF8).set("coordinate_frame", 6);
  m.set("lat_int", as_int(lat_deg)).set("lon_int", as_int(lon_deg)).set_real("alt", height_m);
  if (heading_deg) m.set_real("yaw", *heading_deg * k_degree);
  const bool in_guided = custom_mode_ == dialect.guided;
  if (!in_guided) {  // after a hold: targets outside GUIDED are ignored in silence
    const auto params = mode_params(autopilot_, dialect.guided);
    commanded_s_ = now_s_;
    command(number, "mode", k_set_mode, {1, params.main, params.sub});
  }
  target_ = Target{number,   std::move(m), lat_deg, lon_deg,
                   height_m, now_s_,       now_s_,  distance_m(lat_deg, lon_deg, height_m),
                   false};
  send(target_->message);
  return number;
}

/// No acknowledgement exists for position targets: seen to move there, or to be there, counts.
void Session::drive_target() {
  if (!target_) return;
  auto& t = *target_;
  if (!t.confirmed) {
    const double left_m = distance_m(t.lat_deg, t.lon_deg, t.height_m);
    const bool guided = custom_mode_ == dialect_of(autopilot_).guided;
    if (guided && (left_m < 1.0 || left_m < t.from_m - 0.2)) {
      t.confirmed = true;
      report(t.number, "go_to", CommandState::accepted, "on its way");
    } else if (now_s_ - t.begun_s > options_.confirm_s) {
      t.confirmed = true;
      report(t.number, "go_to", CommandState::unconfirmed, "it does not move towards the target");
    }
  }
  if (now_s_ - t.sent_s >= 1) {
    t.sent_s = now_s_;
    send(t.message);
  }
}

void Session::on_ack(const Message& m) {
  const auto number = m.integer("command");
  const auto result = m.integer("result");
  const auto it =
      std::find_if(pending_.begin(), pending_.end(), [&](const Pending& p) { return p.command == number; });
  if (it == pending_.end()) return;
  if (result == 5) {  // in progress: more follow
    it->first_s = it->last_s = now_s_;
    return;
  }
  const Pending done = *it;
  pending_.erase(it);
  const bool part_of_take_off = take_off_ && take_off_->number == done.number;
  if (part_of_take_off || done.what == "mode") return;  // telemetry decides
  if (result == 0)
    report(done.number, done.what, CommandState::accepted, "");
  else
    report(done.number, done.what, CommandState::refused,
           result_word(result) + (refusal_.empty() ? "" : ": " + refusal_));
}

void Session::repeat_commands() {
  for (auto it = pending_.begin(); it != pending_.end();) {
    if (now_s_ - it->first_s >= options_.confirm_s) {
      const bool part = (take_off_ && take_off_->number == it->number) || it->what == "mode";
      if (!part) report(it->number, it->what, CommandState::unconfirmed, "no answer within 2 s");
      it = pending_.erase(it);
      continue;
    }
    if (it->sent == 1 && now_s_ - it->last_s >= options_.repeat_s) {
      ++it->sent;
      it->last_s = now_s_;
      if (it->message.is("COMMAND_LONG")) it->message.set("confirmation", 1);
      send(it->message);
    }
    ++it;
  }
}

void Session::tick(double now_s, std::int64_t unix_us) {
  now_s_ = now_s;
  packer_.set_time(mavlink::signature_time(unix_us));
  if (now_s_ - heartbeat_s_ >= 1) {
    heartbeat_s_ = now_s_;
    send(Message("HEARTBEAT")
             .set("type", 6)
             .set("autopilot", 8)
             .set("system_status", 4)
             .set("mavlink_version", 3));
  }
  if (!heard_s_) return;
  ask_rates();
  drive_take_off();
  drive_target();
  drive_transfer();
  repeat_commands();
}

DroneStatus Session::status() const {
  DroneStatus out = status_;
  out.autopilot = std::string(dialect_of(autopilot_).name);
  out.silent_s = heard_s_ ? now_s_ - *heard_s_ : now_s_;
  out.connected = heard_s_ && out.silent_s <= 3;
  return out;
}

}  // namespace anchord::drone
