#include "drivers/pozyx/tag.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/pozyx/registers.hpp"
#include "drivers/pozyx/values.hpp"

namespace anchord::pozyx {
namespace {

std::int64_t ns_of(double seconds) { return static_cast<std::int64_t>(seconds * 1e9); }

/// The label under which an error code is counted.
std::string label_of(std::uint8_t error_code) {
  switch (error_code) {
    case 0x12:
    case 0x13:
      return "no_answer";
    case 0x11:
      return "ranging_failed";
    case 0x15:
      return "uwb_busy";
    case 0x17:
      return "not_acknowledged";
    case 0x0e:
      return "unknown_device";
    default:
      return "tag_error";
  }
}

}  // namespace

Script<Result<TagIdentity>> Tag::identify() {
  Result<Bytes> who = co_await wire_.read(reg::who_am_i, 5);
  if (!who) co_return who.error();
  if (who.value()[0] != k_who_am_i) co_return make_error(Errc::bad_frame, "not a Pozyx");
  if (const auto known = check_firmware(who.value()[1]); !known) co_return known.error();
  Result<Bytes> id = co_await wire_.read(reg::network_id, 2);
  if (!id) co_return id.error();
  const Result<UwbSettings> air = co_await uwb();
  if (!air) co_return air.error();
  events_clear_ = false;
  newest_.clear();
  newest_between_.clear();
  calib_read_ns_ = 0;
  co_return TagIdentity{who.value()[1], who.value()[2], who.value()[3], u16_at(id.value(), 0)};
}

Script<Result<std::uint8_t>> Tag::poll(std::uint8_t bits, std::int64_t patience_ns) {
  const std::int64_t until_ns = wire_.now_ns() + patience_ns;
  for (;;) {
    Result<Bytes> events = co_await wire_.read(reg::int_status, 1);
    if (!events) co_return events.error();
    const std::uint8_t seen = events.value()[0];
    if (seen & (bits | event::err)) co_return seen;
    if (wire_.now_ns() >= until_ns) co_return std::uint8_t{0};
    co_await wire_.pause(k_ms);
  }
}

Script<std::string> Tag::failure_of(std::uint8_t events) {
  if (events == 0) co_return "no_event";
  Result<Bytes> code = co_await wire_.read(reg::error_code, 1);
  if (!code) co_return "wire";
  co_return label_of(code.value()[0]);
}

Script<Ranging> Tag::range(std::uint16_t id) {
  Ranging out;
  out.failure = "wire";
  if (!events_clear_) {  // else the result may be one measurement old
    const Result<Bytes> cleared = co_await wire_.read(reg::int_status, 1);
    if (!cleared) co_return out;
  }
  events_clear_ = false;
  Bytes parameters;
  put_u16(parameters, id);
  Result<Bytes> accepted = co_await wire_.call(fn::do_ranging, parameters, 0);
  if (!accepted) {
    if (accepted.error().code == Errc::conflict) out.failure = "refused";
    co_return out;
  }
  // The air time is known; asking before most of it is over only keeps both sides busy.
  const double expected_s = exchange_s(settings_);
  co_await wire_.pause(ns_of(0.5 * expected_s));
  const Result<std::uint8_t> events = co_await poll(event::func, ns_of(0.1 + 2 * expected_s));
  if (!events) co_return out;
  out.seen_ns = wire_.now_ns();
  if (events.value() == 0 || (events.value() & event::err)) {
    out.failure = co_await failure_of(events.value());
    co_return out;
  }
  Result<Bytes> data = co_await wire_.call(fn::device_get_range_info, parameters, k_range_info_bytes);
  if (!data) {
    if (data.error().code == Errc::conflict) out.failure = "refused";
    co_return out;
  }
  events_clear_ = true;
  out.failure.clear();
  out.info = range_info(data.value());
  const auto before = newest_.find(id);
  out.fault = fault_of(out.info, before == newest_.end() ? std::nullopt : std::optional(before->second));
  newest_[id] = out.info;
  co_return out;
}

Script<Result<CirRecord>> Tag::read_cir(CirRead what) {
  CirRecord out;
  struct Piece {
    std::size_t from, count;
    bool noise;
  };
  std::vector<Piece> pieces;
  const auto add = [&pieces](std::size_t from, std::size_t count, bool noise) {
    for (std::size_t at = 0; at < count; at += k_max_cir_per_call)
      pieces.push_back({from + at, std::min(k_max_cir_per_call, count - at), noise});
  };
  switch (what) {
    case CirRead::none:
      break;
    case CirRead::window:
      out.from = k_window_from;
      add(k_window_from, k_window_taps, false);
      add(k_noise_from, k_noise_taps, true);
      break;
    case CirRead::whole:
      add(0, cir_taps(settings_.prf), false);
      break;
  }
  for (const Piece& piece : pieces) {
    Bytes parameters;
    put_u16(parameters, static_cast<std::uint16_t>(piece.from));
    parameters.push_back(static_cast<std::uint8_t>(piece.count));
    Result<Bytes> data = co_await wire_.call(fn::cir_data, parameters, 4 * piece.count);
    if (!data) co_return data.error();
    auto& taps = piece.noise ? out.noise : out.taps;
    for (std::size_t i = 0; i < 2 * piece.count; ++i) taps.push_back(i16_at(data.value(), 2 * i));
  }
  co_return out;
}

Script<Result<std::vector<std::uint16_t>>> Tag::known_devices() {
  std::vector<std::uint16_t> out;
  Result<Bytes> size = co_await wire_.read(reg::device_list_size, 1);
  if (!size) co_return size.error();
  const std::size_t n = std::min<std::size_t>(size.value()[0], k_max_devices);
  if (n == 0) co_return out;
  Bytes parameters{0, static_cast<std::uint8_t>(n)};
  Result<Bytes> ids = co_await wire_.call(fn::devices_get_ids, parameters, 2 * n);
  if (!ids) co_return ids.error();
  for (std::size_t i = 0; i < n; ++i) {
    const std::uint16_t id = u16_at(ids.value(), 2 * i);
    if (id != 0) out.push_back(id);  // 0 is broadcast, not a device
  }
  co_return out;
}

Script<Result<std::vector<std::uint16_t>>> Tag::discover(std::uint8_t type, bool clear_first) {
  if (clear_first) {
    const Result<Bytes> cleared = co_await wire_.call(fn::devices_clear, {}, 0);
    if (!cleared) co_return cleared.error();
  }
  const Result<Bytes> events = co_await wire_.read(reg::int_status, 1);
  if (!events) co_return events.error();
  events_clear_ = false;
  // Slots must hold a whole frame: 4096 symbols at 110 kbit/s want 20 ms or more (inferred in the sheet).
  const bool slow = settings_.preamble_symbols > 1024 || settings_.rate == 0;
  const std::uint8_t slot_ms = slow ? 25 : 10, slots = 3;
  Bytes parameters{type, slots, slot_ms};
  const Result<Bytes> accepted = co_await wire_.call(fn::devices_discover, parameters, 0);
  if (!accepted) co_return accepted.error();
  const Result<std::uint8_t> done = co_await poll(event::func, slot_ms * (slots + 20) * k_ms);
  if (!done) co_return done.error();
  // A discovery that times out or fails may still have found some.
  Result<std::vector<std::uint16_t>> found = co_await known_devices();
  co_return found;
}

Script<Result<UwbSettings>> Tag::uwb() {
  Result<Bytes> registers = co_await wire_.read(reg::uwb_channel, 4);
  if (!registers) co_return registers.error();
  const Result<UwbSettings> settings = uwb_settings(registers.value());
  if (settings) settings_ = settings.value();
  co_return settings;
}

Script<Result<void>> Tag::write_air(UwbSettings settings) {
  Result<Bytes> registers = uwb_registers(settings);
  if (!registers) co_return registers.error();
  wire_.write(reg::uwb_channel, registers.value());
  co_await wire_.pause(20 * k_ms);  // to switch
  if (settings.gain_db) {           // last: the others reset it
    const Bytes gain{gain_register(*settings.gain_db)};
    wire_.write(reg::uwb_gain, gain);
  }
  co_return boost::outcome_v2::success();
}

Script<Result<UwbSettings>> Tag::set_uwb(UwbSettings settings) {
  const Result<void> written = co_await write_air(settings);
  if (!written) co_return written.error();
  const Result<UwbSettings> read = co_await uwb();
  if (!read) co_return read.error();
  if (!same_air(settings, read.value())) {
    co_return make_error(
        Errc::conflict, "set to " + to_string(settings) + ", but the tag reports " + to_string(read.value()));
  }
  co_return read;
}

Script<Result<void>> Tag::set_sensors_mode(std::uint8_t mode) {
  const Bytes data{mode};
  wire_.write(reg::sensors_mode, data);
  co_await wire_.pause(20 * k_ms);
  Result<Bytes> read = co_await wire_.read(reg::sensors_mode, 1);
  if (!read) co_return read.error();
  sensors_mode_ = read.value()[0];
  if (sensors_mode_ != mode) co_return make_error(Errc::conflict, "the sensors do not change their mode");
  co_return boost::outcome_v2::success();
}

Script<Result<std::optional<double>>> Tag::heading_deg() {
  constexpr std::int64_t k_calib_every_ns = 1'000'000'000;
  if (calib_read_ns_ == 0 || wire_.now_ns() - calib_read_ns_ > k_calib_every_ns) {
    Result<Bytes> status = co_await wire_.read(reg::calib_status, 1);
    if (!status) co_return status.error();
    calib_status_ = status.value()[0];
    calib_read_ns_ = wire_.now_ns();
  }
  Result<Bytes> euler = co_await wire_.read(reg::euler, 2);
  if (!euler) co_return euler.error();
  co_return absolute_heading_deg(i16_at(euler.value(), 0), sensors_mode_, calib_status_);
}

Script<Result<void>> Tag::reset() {
  const Result<Bytes> accepted = co_await wire_.call(fn::reset, {}, 0);
  if (!accepted) co_return accepted.error();
  co_await wire_.pause(1000 * k_ms);
  const Result<void> again = co_await wire_.resync();
  co_return again;
}

Script<Result<void>> Tag::light(std::optional<std::uint16_t> other, bool on) {
  Bytes parameters(1, static_cast<std::uint8_t>(on ? 0xff : 0xf0));
  Result<Bytes> accepted = make_error(Errc::link_lost, "");
  if (other) {
    // Frames are lost, and this may be said again.
    for (int i = 0; i < 3 && !accepted; ++i) {
      accepted = co_await remote_call(*other, fn::led_ctrl, parameters, 0);
    }
  } else {
    accepted = co_await wire_.call(fn::led_ctrl, parameters, 0);
  }
  if (!accepted) co_return accepted.error();
  co_return boost::outcome_v2::success();
}

Script<Result<void>> Tag::set_light_control(std::optional<std::uint16_t> other, std::uint8_t config) {
  Bytes data(1, config);
  if (!other) {
    wire_.write(reg::config_leds, data);
    co_return boost::outcome_v2::success();
  }
  const Result<void> written = co_await remote_write(*other, reg::config_leds, data);
  co_return written;
}

Script<Result<void>> Tag::blink(std::optional<std::uint16_t> other) {
  constexpr int k_flashes = 3;
  Result<Bytes> config = make_error(Errc::link_lost, "");
  if (other) {
    config = co_await remote_read(*other, reg::config_leds, 1);
  } else {
    config = co_await wire_.read(reg::config_leds, 1);
  }
  if (!config) co_return config.error();
  // Lights that are under system control show nothing of LED_CTRL.
  const std::uint8_t before = config.value()[0];
  Result<void> done = co_await set_light_control(other, before & 0xf0);
  for (int i = 0; done && i < 2 * k_flashes; ++i) {
    done = co_await light(other, i % 2 == 0);
    co_await wire_.pause(200 * k_ms);
  }
  const Result<void> given_back = co_await set_light_control(other, before);
  co_return done ? given_back : done;
}

Script<bool> Tag::listed_as_tag(std::uint16_t id) {
  constexpr std::size_t k_info_bytes = 15, k_flag_at = 2;
  constexpr std::uint8_t k_tag = 2;
  Bytes parameters;
  put_u16(parameters, id);
  const Result<Bytes> info = co_await wire_.call(fn::device_get_info, parameters, k_info_bytes);
  co_return info&& info.value()[k_flag_at] == k_tag;
}

Script<Result<DeviceInfo>> Tag::stored_position(std::uint16_t id) {
  Bytes parameters;
  put_u16(parameters, id);
  Result<Bytes> data = co_await wire_.call(fn::device_get_coords, parameters, 12);
  if (!data) co_return make_error(data.error().code, to_string(NetworkId{id}) + ": " + data.error().message);
  co_return DeviceInfo{id, true, coordinates_m(data.value())};
}

}  // namespace anchord::pozyx
