#include "drivers/sim/pozyx_device.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/pozyx/registers.hpp"

namespace anchord::sim {

using namespace pozyx;

PozyxDevice::PozyxDevice(std::uint16_t id, bool is_tag, std::uint8_t firmware, std::uint8_t rates,
                         std::uint8_t plen)
    : label_(id), is_tag_(is_tag), firmware_(firmware), rates_(rates), plen_(plen) {
  start();
}

void PozyxDevice::start() {
  memory_.fill(0);
  memory_[reg::who_am_i] = k_who_am_i;
  memory_[reg::firmware] = firmware_;
  memory_[reg::hardware] = is_tag_ ? 0x23 : 0x03;
  memory_[reg::selftest] = is_tag_ ? 0x3f : 0x30;
  memory_[reg::config_leds] = 0x3f;  // all lights under system control
  memory_[reg::pos_num_anchors] = 0x84;
  memory_[reg::network_id] = static_cast<std::uint8_t>(label_ & 0xff);
  memory_[reg::network_id + 1] = static_cast<std::uint8_t>(label_ >> 8);
  memory_[reg::uwb_channel] = 5;
  memory_[reg::uwb_rates] = rates_;
  memory_[reg::uwb_plen] = plen_;
  memory_[reg::uwb_gain] = 0x17;
  memory_[reg::operation_mode] = is_tag_ ? 0 : 1;
  for (const auto& [address, value] : flash_) memory_[address] = value;
  list_ = saved_list_;
}

void PozyxDevice::reset() {
  ranges_.clear();
  impulse_.clear();
  start();
}

Bytes PozyxDevice::read(std::uint8_t address, std::size_t n) {
  memory_[reg::device_list_size] = static_cast<std::uint8_t>(list_.size());
  Bytes out(n);
  for (std::size_t i = 0; i < n; ++i) {
    const auto at = static_cast<std::uint8_t>(address + i);
    out[i] = memory_[at];
    if (at == reg::int_status) memory_[at] = 0;
  }
  return out;
}

void PozyxDevice::write(std::uint8_t address, ByteView data) {
  bool new_air = false;
  for (std::size_t i = 0; i < data.size(); ++i) {
    const auto at = static_cast<std::uint8_t>(address + i);
    const Register* row = register_at(at);
    if (!row || row->access == Access::read) continue;
    memory_[at] = data[i];
    new_air = new_air || (at >= reg::uwb_channel && at <= reg::uwb_plen);
    if (new_air && at != reg::uwb_gain) memory_[reg::uwb_gain] = 0x17;
    if (at == reg::sensors_mode) memory_[reg::calib_status] = is_tag_ && data[i] >= 8 ? 0xff : 0;
  }
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

PozyxDevice::Answer PozyxDevice::save(ByteView parameters) {
  if (parameters.empty() || parameters[0] < 1 || parameters[0] > 4) return {false, {}};
  if (parameters[0] == 1) {
    // Saving the gain does not work on the device either.
    for (const std::uint8_t address : parameters.subspan(1)) {
      if (address != reg::uwb_gain) flash_[address] = memory_[address];
    }
  }
  if (parameters[0] >= 3) saved_list_ = list_;
  return {};
}

PozyxDevice::Answer PozyxDevice::impulse(ByteView parameters) const {
  if (parameters.size() != 3) return {false, {}};
  const std::size_t offset = u16_at(parameters, 0), count = parameters[2];
  if (count < 1 || count > k_max_cir_per_call || offset + count > 1016) return {false, {}};
  Answer answer;
  for (std::size_t i = 2 * offset; i < 2 * (offset + count); ++i)
    put_u16(answer.result, i < impulse_.size() ? static_cast<std::uint16_t>(impulse_[i]) : 0);
  return answer;
}

std::optional<PozyxDevice::Answer> PozyxDevice::call(std::uint8_t function, ByteView parameters) {
  const auto refuse = [this](std::uint8_t error_code) {
    memory_[reg::error_code] = error_code;
    return Answer{false, {}};
  };
  const Known* device = known(parameters);
  Answer answer;
  switch (function) {
    case fn::led_ctrl: {
      if (parameters.size() != 1) return refuse(0x0d);
      // Only lights that are not under system control follow.
      const unsigned free = (parameters[0] >> 4) & ~unsigned{memory_[reg::config_leds]} & 0x0f;
      const unsigned now = (lights_ & ~free) | (parameters[0] & free);
      flashes_ += (now & ~unsigned{lights_}) != 0;
      lights_ = static_cast<std::uint8_t>(now & 0x0f);
      return answer;
    }
    case fn::pos_set_anchor_ids:
      return answer;
    case fn::pos_get_anchor_ids:
      return get_ids({});
    case fn::flash_reset:
      flash_.clear();
      saved_list_.clear();
      return answer;
    case fn::flash_save:
      return save(parameters);
    case fn::flash_details:
      answer.result.resize(20);
      for (const auto& [address, value] : flash_) {
        if (address < 160) answer.result[address / 8u] |= static_cast<std::uint8_t>(1u << (address % 8u));
      }
      return answer;
    case fn::devices_get_ids:
      return get_ids(parameters);
    case fn::devices_clear:
      list_.clear();
      return answer;
    case fn::device_add: {
      if (parameters.size() != 15) return refuse(0x0d);
      Known added{u16_at(parameters, 0), parameters[2] == 1, {parameters.begin() + 3, parameters.end()}};
      return remember(added) ? answer : refuse(0x03);
    }
    case fn::device_get_info:
      if (!device) return refuse(0x0e);
      put_u16(answer.result, device->id);
      answer.result.push_back(device->anchor ? 1 : 2);
      answer.result.insert(answer.result.end(), device->coordinates.begin(), device->coordinates.end());
      return answer;
    case fn::device_get_coords:
      if (!device) return refuse(0x0e);
      answer.result = device->coordinates;
      return answer;
    case fn::device_get_range_info: {
      if (parameters.size() != 2) return refuse(0x0d);
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
      return answer.accepted ? answer : refuse(0x0d);
    default:
      return std::nullopt;
  }
}

}  // namespace anchord::sim
