#include "drivers/sim/pozyx_device.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/pozyx/registers.hpp"

namespace anchord::sim {

using namespace pozyx;

namespace {

// Codes of register 04 that this device gives by itself; pozyx-serial.md section 9.
constexpr std::uint8_t k_write_refused = 0x01, k_list_full = 0x03, k_uwb_refused = 0x06,
                       k_bad_parameters = 0x0d, k_not_found = 0x0e;

/// Why a register does not take a value, as an error code; 0: it does. The description has the legal values
/// of the radio registers and error 06 for them; what a tag says to a sensor or operation mode without a
/// meaning is not written anywhere: bad parameters, as for functions.
std::uint8_t refusal(std::uint8_t address, std::uint8_t value) {
  constexpr std::string_view k_preambles("\x0c\x28\x18\x08\x34\x24\x14\x04", 8);
  switch (address) {
    case reg::uwb_channel:
      return value >= 1 && value <= 7 && value != 6 ? 0 : k_uwb_refused;
    case reg::uwb_rates:
      return (value & 0x3f) <= 2 && (value >> 6 == 1 || value >> 6 == 2) ? 0 : k_uwb_refused;
    case reg::uwb_plen:
      return k_preambles.find(static_cast<char>(value)) != std::string_view::npos ? 0 : k_uwb_refused;
    case reg::uwb_gain:
      return value <= 67 ? 0 : k_uwb_refused;
    case reg::operation_mode:
      return value <= 2 ? 0 : k_bad_parameters;
    case reg::sensors_mode:
      return value <= 12 ? 0 : k_bad_parameters;
    default:
      return 0;
  }
}

}  // namespace

PozyxDevice::PozyxDevice(std::uint16_t id, bool is_tag, std::uint8_t firmware, std::uint8_t rates,
                         std::uint8_t plen)
    : label_(id), is_tag_(is_tag), firmware_(firmware), rates_(rates), plen_(plen) {
  start();
}

Bytes PozyxDevice::Answer::with_status() const {
  Bytes out(result.size() + 1);
  out[0] = accepted ? 1 : 0;
  std::copy(result.begin(), result.end(), out.begin() + 1);
  return out;
}

void PozyxDevice::start() {
  memory_.fill(0);
  memory_[reg::who_am_i] = k_who_am_i;
  memory_[reg::firmware] = firmware_;
  // Type 1 is a tag, as the description and the masks of the maker's client have it; its DeviceDetails reads
  // the type as an operation mode, and calls tags anchors.
  memory_[reg::hardware] = is_tag_ ? 0x23 : 0x03;
  memory_[reg::selftest] = is_tag_ ? 0x3f : 0x30;
  memory_[reg::config_leds] = 0x3f;  // all lights under system control
  // Three dimensions: the register text says two, the maker's own test of a reset that it is not 0x20.
  memory_[reg::pos_alg] = 0x30;
  memory_[reg::pos_num_anchors] = 0x84;
  memory_[reg::network_id] = static_cast<std::uint8_t>(label_ & 0xff);
  memory_[reg::network_id + 1] = static_cast<std::uint8_t>(label_ >> 8);
  memory_[reg::uwb_channel] = 5;
  memory_[reg::uwb_rates] = rates_;
  memory_[reg::uwb_plen] = plen_;
  memory_[reg::uwb_gain] = 0x17;
  memory_[reg::operation_mode] = is_tag_ ? 0 : 1;
  // The maker's orientation tutorial reads all sensors without ever setting a mode: a tag starts in fusion.
  // Its compass is not calibrated then.
  memory_[reg::sensors_mode] = is_tag_ ? 12 : 0;
  for (const auto& [address, bytes] : flash_) set_bytes(address, bytes);
  list_ = saved_list_;
  positioning_ids_ = saved_positioning_ids_;
}

void PozyxDevice::reset() {
  ranges_.clear();
  impulse_.clear();
  tx_size_ = 0;
  unread_ = false;
  start();
}

Bytes PozyxDevice::read(std::uint8_t address, std::size_t n) {
  memory_[reg::device_list_size] = static_cast<std::uint8_t>(list_.size());
  Bytes out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::uint8_t>(address + i);
    out[i] = memory_[at];
    if (at == reg::int_status || at == reg::max_lin_acc || at == reg::max_lin_acc + 1) memory_[at] = 0;
  }
  return out;
}

bool PozyxDevice::write(std::uint8_t address, ByteView data) {
  bool all = true;
  for (std::size_t i = 0; i < data.size(); ++i)
    all = write_one(static_cast<std::uint8_t>(address + i), data[i]) && all;
  return all;
}

bool PozyxDevice::write_one(std::uint8_t at, std::uint8_t value) {
  const Register* row = register_at(at);
  const std::uint8_t why = !row || row->access == Access::read ? k_write_refused : refusal(at, value);
  if (why != 0) {
    fail(why);
    return false;
  }
  memory_[at] = value;
  if (at >= reg::uwb_channel && at <= reg::uwb_plen) memory_[reg::uwb_gain] = 0x17;
  if (at == reg::sensors_mode) memory_[reg::calib_status] = is_tag_ && value >= 8 ? 0xff : 0;
  return true;
}

void PozyxDevice::receive(std::uint16_t from, Bytes message, std::uint8_t events) {
  if (message.size() > rx_.size()) message.resize(rx_.size());
  std::copy(message.begin(), message.end(), rx_.begin());
  Bytes header;
  put_u16(header, from);
  header.push_back(static_cast<std::uint8_t>(message.size()));
  set_bytes(reg::rx_network_id, header);
  unread_ = true;
  raise(events);
}

void PozyxDevice::fail(std::uint8_t error_code) {
  memory_[reg::error_code] = error_code;
  raise(event::err);
}

std::uint16_t PozyxDevice::id() const { return u16_at(memory_, reg::network_id); }

std::array<std::uint8_t, 3> PozyxDevice::air() const {
  return {memory_[reg::uwb_channel], memory_[reg::uwb_rates], memory_[reg::uwb_plen]};
}

double PozyxDevice::exchange_s() const {
  const auto settings = uwb_settings(ByteView(memory_).subspan(reg::uwb_channel, 4));
  return settings ? pozyx::exchange_s(settings.value()) : 0.030;
}

bool PozyxDevice::list_has(std::uint16_t id) const {
  return std::any_of(list_.begin(), list_.end(), [id](const Known& known) { return known.id == id; });
}

bool PozyxDevice::remember(const Known& device) {
  for (Known& known : list_) {
    if (known.id != device.id) continue;
    known = device;
    return true;
  }
  if (list_.size() >= k_max_devices) return false;
  list_.push_back(device);
  return true;
}

void PozyxDevice::set_i16(std::uint8_t address, double value) {
  const auto raw = static_cast<std::uint16_t>(
      static_cast<std::int16_t>(std::lround(std::clamp(value, -32768.0, 32767.0))));
  memory_[address] = static_cast<std::uint8_t>(raw & 0xff);
  memory_[address + 1u] = static_cast<std::uint8_t>(raw >> 8);
}

void PozyxDevice::set_bytes(std::uint8_t address, ByteView data) {
  std::copy(data.begin(), data.end(), memory_.begin() + address);
}

const PozyxDevice::Known* PozyxDevice::known(ByteView id) const {
  if (id.size() < 2) return nullptr;
  const auto found = std::find_if(list_.begin(), list_.end(),
                                  [&](const Known& device) { return device.id == u16_at(id, 0); });
  return found == list_.end() ? nullptr : &*found;
}

PozyxDevice::Answer PozyxDevice::get_ids(ByteView parameters) const {
  const std::size_t offset = parameters.empty() ? 0 : parameters[0];
  const std::size_t count = parameters.size() > 1 ? parameters[1] : list_.size();
  Answer answer;
  for (std::size_t i = offset; i < std::min(list_.size(), offset + count); ++i)
    put_u16(answer.result, list_[i].id);
  return answer;
}

PozyxDevice::Answer PozyxDevice::positioning_ids_answer() const {
  // With automatic selection the tag fills the list itself; before that it has only its anchors to show.
  if (positioning_ids_.empty()) return get_ids({});
  Answer answer;
  for (const std::uint16_t id : positioning_ids_) put_u16(answer.result, id);
  return answer;
}

PozyxDevice::Answer PozyxDevice::save(ByteView parameters) {
  if (parameters.empty() || parameters[0] < 1 || parameters[0] > 4) {
    fail(k_bad_parameters);
    return {false, {}};
  }
  const auto keep = [this](std::uint8_t address) {
    const Register* row = register_at(address);
    // Saving the gain does not work on the device either.
    if (!row || row->access == Access::read || row->address == reg::uwb_gain) return;
    flash_[row->address] = Bytes(memory_.begin() + row->address, memory_.begin() + row->address + row->bytes);
  };
  if (parameters[0] == 1) std::for_each(parameters.begin() + 1, parameters.end(), keep);
  if (parameters[0] == 4) {
    for (const Register& row : k_registers) keep(row.address);
  }
  if (parameters[0] == 2 || parameters[0] == 4) saved_positioning_ids_ = positioning_ids_;
  if (parameters[0] >= 3) saved_list_ = list_;
  return {};
}

/// Offset 0..1015 and 1..49 coefficients are what the description allows, each for itself. It does not say
/// what follows the last coefficient: a published reader of the maker's client asks 49 at 980 all the same
/// and goes on with what it gets, so that it is answered here, with zeros.
PozyxDevice::Answer PozyxDevice::impulse(ByteView parameters) const {
  if (parameters.size() != 3) return {false, {}};
  const std::size_t offset = u16_at(parameters, 0), count = parameters[2];
  if (offset >= 1016 || count < 1 || count > k_max_cir_per_call) return {false, {}};
  Answer answer;
  for (std::size_t i = 2 * offset; i < 2 * (offset + count); ++i)
    put_u16(answer.result, i < impulse_.size() ? static_cast<std::uint16_t>(impulse_[i]) : 0);
  return answer;
}

/// Offset, bytes; the newest write ends the message.
bool PozyxDevice::write_message(ByteView parameters) {
  if (parameters.empty() || parameters[0] + parameters.size() - 1 > tx_.size()) return false;
  std::copy(parameters.begin() + 1, parameters.end(), tx_.begin() + parameters[0]);
  tx_size_ = parameters[0] + parameters.size() - 1;
  return true;
}

/// Only lights that are not under system control follow.
bool PozyxDevice::set_lights(ByteView parameters) {
  if (parameters.size() != 1) return false;
  const unsigned free = (parameters[0] >> 4) & ~unsigned{memory_[reg::config_leds]} & 0x0f;
  const unsigned now = (lights_ & ~free) | (parameters[0] & free);
  flashes_ += (now & ~unsigned{lights_}) != 0;
  lights_ = static_cast<std::uint8_t>(now & 0x0f);
  return true;
}

bool PozyxDevice::set_positioning_ids(ByteView parameters) {
  if (parameters.empty() || parameters.size() % 2 != 0 || parameters.size() > 32) return false;
  positioning_ids_.clear();
  for (std::size_t i = 0; i < parameters.size(); i += 2) positioning_ids_.push_back(u16_at(parameters, i));
  return true;
}

std::optional<PozyxDevice::Answer> PozyxDevice::call(std::uint8_t function, ByteView parameters) {
  const auto refuse = [this](std::uint8_t error_code) {
    fail(error_code);
    return Answer{false, {}};
  };
  const Known* device = known(parameters);
  Answer answer;
  switch (function) {
    case fn::tx_data:
      return write_message(parameters) ? answer : refuse(k_bad_parameters);
    case fn::rx_data: {  // offset, count
      if (parameters.size() != 2 || std::size_t{parameters[0]} + parameters[1] > rx_.size())
        return refuse(k_bad_parameters);
      const auto from = rx_.begin() + parameters[0];
      answer.result.assign(from, from + parameters[1]);
      unread_ = false;
      return answer;
    }
    case fn::led_ctrl:
      return set_lights(parameters) ? answer : refuse(k_bad_parameters);
    case fn::pos_set_anchor_ids:
      return set_positioning_ids(parameters) ? answer : refuse(k_bad_parameters);
    case fn::pos_get_anchor_ids:
      return positioning_ids_answer();
    case fn::flash_reset:
      flash_.clear();
      saved_list_.clear();
      saved_positioning_ids_.clear();
      return answer;
    case fn::flash_save:
      return save(parameters);
    case fn::flash_details:
      answer.result.resize(20);
      for (const auto& [address, bytes] : flash_) {
        if (address < 160) answer.result[address / 8u] |= static_cast<std::uint8_t>(1u << (address % 8u));
      }
      return answer;
    case fn::devices_get_ids:
      return get_ids(parameters);
    case fn::devices_clear:
      list_.clear();
      return answer;
    case fn::device_add: {
      if (parameters.size() != 15) return refuse(k_bad_parameters);
      Known added{u16_at(parameters, 0), parameters[2] == 1, {parameters.begin() + 3, parameters.end()}};
      return remember(added) ? answer : refuse(k_list_full);
    }
    case fn::device_get_info:
      if (!device) return refuse(k_not_found);
      put_u16(answer.result, device->id);
      // As the description has it; getTagIds and getAnchorIds of the maker's client expect them swapped.
      answer.result.push_back(device->anchor ? 1 : 2);
      answer.result.insert(answer.result.end(), device->coordinates.begin(), device->coordinates.end());
      return answer;
    case fn::device_get_coords:
      if (!device) return refuse(k_not_found);
      answer.result = device->coordinates;
      return answer;
    case fn::device_get_range_info: {
      if (parameters.size() != 2) return refuse(k_bad_parameters);
      const auto found = ranges_.find(u16_at(parameters, 0));
      // Never ranged: uninitialised memory, as issue 47 of the maker's library shows it.
      const RangeInfo info = found == ranges_.end() ? RangeInfo{0, 167772160, 0x2000} : found->second;
      put_u32(answer.result, info.time_ms);
      put_u32(answer.result, info.distance_mm);
      put_u16(answer.result, static_cast<std::uint16_t>(info.rss_dbm));
      return answer;
    }
    case fn::cir_data:
      answer = impulse(parameters);
      return answer.accepted ? answer : refuse(k_bad_parameters);
    default:
      return std::nullopt;
  }
}

}  // namespace anchord::sim
