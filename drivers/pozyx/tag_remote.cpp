// What goes through the tag's radio to other devices: relayed ranging, remote registers and functions.
#include <algorithm>

#include "drivers/pozyx/registers.hpp"
#include "drivers/pozyx/tag.hpp"
#include "drivers/pozyx/values.hpp"

namespace anchord::pozyx {
namespace {

constexpr std::int64_t k_remote_ns = 1'000 * k_ms;  ///< the maker's patience for an acknowledgement
constexpr int k_remote_tries = 3;                   ///< frames are lost; the calls here may be repeated

bool near_mm(const Eigen::Vector3d& a_m, const Eigen::Vector3d& b_m) {
  return (a_m - b_m).cwiseAbs().maxCoeff() <= 0.000501;  // written to the nearest millimetre
}

}  // namespace

Script<Result<void>> Tag::transmit(std::uint16_t id, std::uint8_t operation, Bytes message) {
  events_clear_ = false;
  Bytes buffer{0};
  buffer.insert(buffer.end(), message.begin(), message.end());
  Result<Bytes> cleared = co_await wire_.read(reg::int_status, 1);
  if (!cleared) co_return cleared.error();
  Result<Bytes> loaded = co_await wire_.call(fn::tx_data, buffer, 0);
  if (!loaded) co_return loaded.error();
  cleared = co_await wire_.read(reg::int_status, 1);
  if (!cleared) co_return cleared.error();
  Bytes parameters;
  put_u16(parameters, id);
  parameters.push_back(operation);
  Result<Bytes> sent = co_await wire_.call(fn::tx_send, parameters, 0);
  if (!sent) co_return sent.error();
  const Result<std::uint8_t> events = co_await poll(event::func, k_remote_ns);
  if (!events) co_return events.error();
  if (events.value() == 0 || (events.value() & event::err)) {
    const std::string why = co_await failure_of(events.value());
    co_return make_error(Errc::not_found, to_string(NetworkId{id}) + " does not answer: " + why);
  }
  co_return boost::outcome_v2::success();
}

Script<Result<Bytes>> Tag::receive(std::uint16_t id, std::size_t n) {
  Result<Bytes> header = co_await wire_.read(reg::rx_network_id, 3);
  if (!header) co_return header.error();
  // Else the buffer holds somebody else's message.
  if (u16_at(header.value(), 0) != id || header.value()[2] != n) {
    co_return make_error(Errc::bad_frame, "a message of " + std::to_string(header.value()[2]) +
                                              " bytes from " +
                                              to_string(NetworkId{u16_at(header.value(), 0)}) + ", not " +
                                              std::to_string(n) + " from " + to_string(NetworkId{id}));
  }
  Bytes parameters{0, static_cast<std::uint8_t>(n)};
  Result<Bytes> data = co_await wire_.call(fn::rx_data, parameters, n);
  co_return data;
}

Script<Result<Bytes>> Tag::remote_read(std::uint16_t id, std::uint8_t address, std::size_t n) {
  Error last;
  for (int i = 0; i < k_remote_tries; ++i) {
    Bytes message{address, static_cast<std::uint8_t>(n)};
    Result<void> sent = co_await transmit(id, remote::read, message);
    if (sent) {
      Result<Bytes> data = co_await receive(id, n);
      if (data) co_return data;
      last = data.error();
    } else {
      last = sent.error();
    }
    if (last.code == Errc::link_lost) break;
  }
  co_return last;
}

Script<Result<void>> Tag::remote_write(std::uint16_t id, std::uint8_t address, Bytes data) {
  Error last;
  for (int i = 0; i < k_remote_tries; ++i) {
    Bytes message{address};
    message.insert(message.end(), data.begin(), data.end());
    Result<void> sent = co_await transmit(id, remote::write, message);
    if (sent) co_return sent;
    last = sent.error();
    if (last.code == Errc::link_lost) break;
  }
  co_return last;
}

Script<Result<Bytes>> Tag::remote_call(std::uint16_t id, std::uint8_t function, Bytes parameters,
                                       std::size_t result_bytes) {
  Bytes message{function};
  message.insert(message.end(), parameters.begin(), parameters.end());
  Result<void> sent = co_await transmit(id, remote::function, message);
  if (!sent) co_return sent.error();
  Result<Bytes> data = co_await receive(id, result_bytes + 1);
  if (!data) co_return data.error();
  if (data.value().front() != 1) co_return make_error(Errc::conflict, to_string(NetworkId{id}) + " refuses");
  data.value().erase(data.value().begin());
  co_return data;
}

Script<Ranging> Tag::range_between(std::uint16_t from, std::uint16_t to) {
  Ranging out;
  Bytes parameters;
  put_u16(parameters, to);
  Result<Bytes> accepted = co_await remote_call(from, fn::do_ranging, parameters, 0);
  if (!accepted) {
    out.failure = accepted.error().code == Errc::link_lost ? "wire" : "not_acknowledged";
    co_return out;
  }
  const Result<std::uint8_t> events =
      co_await poll(event::rx_data, static_cast<std::int64_t>((0.1 + 2 * exchange_s(settings_)) * 1e9));
  out.seen_ns = wire_.now_ns();
  if (!events || events.value() == 0 || (events.value() & event::err)) {
    out.failure = events ? "no_answer" : "wire";
    co_return out;
  }
  Result<Bytes> data = co_await remote_call(from, fn::device_get_range_info, parameters, k_range_info_bytes);
  if (!data) {
    out.failure = data.error().code == Errc::link_lost ? "wire" : "not_acknowledged";
    co_return out;
  }
  out.info = range_info(data.value());
  const auto before = newest_between_.find({from, to});
  out.fault =
      fault_of(out.info, before == newest_between_.end() ? std::nullopt : std::optional(before->second));
  newest_between_[{from, to}] = out.info;
  co_return out;
}

Script<Result<void>> Tag::set_remote_uwb(std::uint16_t id, UwbSettings settings) {
  Result<Bytes> registers = uwb_registers(settings);
  if (!registers) co_return registers.error();
  Result<void> written = co_await remote_write(id, reg::uwb_channel, registers.value());
  co_return written;
}

Script<Result<Applied>> Tag::set_uwb_everywhere(UwbSettings settings, std::vector<std::uint16_t> others) {
  if (const auto possible = uwb_registers(settings); !possible) co_return possible.error();
  const Result<UwbSettings> read = co_await uwb();
  if (!read) co_return read.error();
  const UwbSettings old = read.value();
  Applied out;
  bool all = true;
  // Whoever has changed hears us no more, and whether its acknowledgement still goes out with the old
  // settings is not known: a device is judged by what it answers on the new ones, not by this.
  for (const std::uint16_t id : others) {
    const Result<void> sent = co_await set_remote_uwb(id, settings);
    if (!sent && sent.error().code == Errc::link_lost) co_return sent.error();
    out.devices.push_back({id, false, sent ? "" : sent.error().message});
  }
  const Result<UwbSettings> own = co_await set_uwb(settings);
  for (DeviceOutcome& device : out.devices) {
    if (!own) break;
    Result<Bytes> registers = co_await remote_read(device.id, reg::uwb_channel, 4);
    if (registers) {
      const Result<UwbSettings> theirs = uwb_settings(registers.value());
      device.done = theirs && same_air({settings.channel, settings.rate, settings.prf,
                                        settings.preamble_symbols, std::nullopt},
                                       theirs.value());
      device.why = device.done ? "" : "still has other settings";
      if (device.done && settings.gain_db) {
        Bytes gain{gain_register(*settings.gain_db)};
        const Result<void> written = co_await remote_write(device.id, reg::uwb_gain, gain);
        if (!written) device.why = "gain: " + written.error().message;
        device.done = static_cast<bool>(written);
      }
    } else if (device.why.empty()) {
      device.why = registers.error().message;
    }
    all = all && device.done;
  }
  out.all = all && own;
  if (out.all) co_return out;
  // Back: those that follow us are told on the new settings, then we go ourselves, then all are asked.
  for (const DeviceOutcome& device : out.devices) {
    if (!device.done) continue;
    const Result<void> told = co_await set_remote_uwb(device.id, old);
    if (!told && told.error().code == Errc::link_lost) co_return told.error();
  }
  const Result<UwbSettings> back = co_await set_uwb(old);
  out.rolled_back = static_cast<bool>(back);
  for (DeviceOutcome& device : out.devices) {
    if (!back) break;
    Result<Bytes> registers = co_await remote_read(device.id, reg::uwb_channel, 4);
    Result<UwbSettings> theirs = make_error(Errc::not_found, "");
    if (registers) theirs = uwb_settings(registers.value());
    const bool follows =
        theirs && same_air({old.channel, old.rate, old.prf, old.preamble_symbols, {}}, theirs.value());
    if (device.done && follows) device.why = "back to the old settings";
    if (!follows) device.why = "answers neither on the new nor on the old settings: " + device.why;
    out.rolled_back = out.rolled_back && (follows || !device.done);
    device.done = false;
  }
  co_return out;
}

Script<Result<Applied>> Tag::push_positions(std::vector<DeviceInfo> devices, bool save) {
  if (devices.empty() || devices.size() > k_max_devices)
    co_return make_error(Errc::invalid_argument, "a tag stores 1 to 20 devices");
  std::vector<Bytes> parameters;
  for (const DeviceInfo& device : devices) {
    Result<Bytes> one = device_add_parameters(device);
    if (!one) co_return one.error();
    parameters.push_back(one.value());
  }
  Result<Bytes> cleared = co_await wire_.call(fn::devices_clear, {}, 0);
  if (!cleared) co_return cleared.error();
  for (const Bytes& one : parameters) {
    const Result<Bytes> added = co_await wire_.call(fn::device_add, one, 0);
    if (!added) co_return added.error();
  }
  const Bytes selection{static_cast<std::uint8_t>(0x80 | std::min<std::size_t>(devices.size(), 15))};
  wire_.write(reg::pos_num_anchors, selection);
  if (save) {
    Bytes what{3};
    const Result<Bytes> saved = co_await wire_.call(fn::flash_save, what, 0);
    if (!saved) co_return saved.error();
    co_await wire_.pause(500 * k_ms);
  }
  Applied out;
  out.all = true;
  for (std::size_t i = 0; i < devices.size(); ++i) {
    const DeviceInfo& device = devices[i];
    DeviceOutcome outcome{device.id, false, {}};
    const Result<DeviceInfo> stored = co_await stored_position(device.id);
    if (!stored) {
      outcome.why = stored.error().message;
    } else if (!near_mm(stored.value().local_m, device.local_m)) {
      outcome.why = "the tag stored another position";
    } else {
      Bytes coordinates(parameters[i].begin() + 3, parameters[i].end());
      const Result<void> told = co_await remote_write(device.id, reg::pos_x, coordinates);
      Result<Bytes> read = make_error(Errc::not_found, told ? "" : told.error().message);
      if (told) read = co_await remote_read(device.id, reg::pos_x, 12);
      if (read && read.value() == coordinates) {
        outcome.done = true;
      } else {
        outcome.why = "stored in the tag, not in the anchor: " +
                      (read ? "it reports another position" : read.error().message);
      }
    }
    out.all = out.all && outcome.done;
    out.devices.push_back(outcome);
  }
  co_return out;
}

}  // namespace anchord::pozyx
