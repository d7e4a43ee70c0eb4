#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "drivers/pozyx/protocol.hpp"
#include "drivers/pozyx/registers.hpp"
#include "drivers/pozyx/values.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim {

/// Registers, device list and flash of one simulated tag or anchor: what a question asks about, without the
/// radio. Pure; not thread-safe.
class PozyxDevice {
 public:
  struct Known {
    std::uint16_t id{};
    bool anchor{true};
    pozyx::Bytes coordinates = pozyx::Bytes(12);  ///< three i32, mm
  };
  struct Answer {
    bool accepted{true};
    pozyx::Bytes result;
    pozyx::Bytes with_status() const;  ///< as it goes out: status byte, result
  };

  PozyxDevice(std::uint16_t id, bool is_tag, std::uint8_t firmware, std::uint8_t rates, std::uint8_t plen);

  /// Reading INT_STATUS and MAX_LIN_ACC clears them.
  pozyx::Bytes read(std::uint8_t address, std::size_t n);
  /// What cannot be written stays as it is, with an error event. False: something of it did.
  bool write(std::uint8_t address, pozyx::ByteView data);
  /// Functions that end at once: buffers, lists, coordinates, range info, flash, impulse response. Nothing:
  /// the function is not one of these.
  std::optional<Answer> call(std::uint8_t function, pozyx::ByteView parameters);

  void raise(std::uint8_t events) { memory_[pozyx_int_status] |= events; }
  /// A message from the air: receive buffer, its header registers, events. Beyond 100 bytes it is cut.
  void receive(std::uint16_t from, pozyx::Bytes message, std::uint8_t events);
  pozyx::ByteView message() const {
    return pozyx::ByteView(tx_).first(tx_size_);
  }  ///< of the transmit buffer
  /// The newest message was not read yet.
  bool unread() const { return unread_; }
  void fail(std::uint8_t error_code);  ///< ERR event and register 04
  void reset();                        ///< RESET_SYS: what is not in flash is lost

  std::uint16_t id() const;
  bool is_tag() const { return is_tag_; }
  /// Channel, rates, preamble: equal at both ends or they do not hear each other.
  std::array<std::uint8_t, 3> air() const;
  double exchange_s() const;  ///< of the settings now
  bool list_has(std::uint16_t id) const;
  /// False where the list is full.
  bool remember(const Known& device);
  std::vector<Known>& list() { return list_; }
  std::vector<std::uint16_t>& positioning_ids() { return positioning_ids_; }
  std::map<std::uint16_t, pozyx::RangeInfo>& ranges() { return ranges_; }
  void set_impulse(std::vector<std::int16_t> taps) { impulse_ = std::move(taps); }
  void set_i16(std::uint8_t address, double value);
  void set_bytes(std::uint8_t address, pozyx::ByteView data);
  int flashes() const { return flashes_; }  ///< times a host switched a light on
  std::uint8_t register_value(std::uint8_t address) const { return memory_[address]; }

 private:
  static constexpr std::uint8_t pozyx_int_status = 0x05;
  bool write_one(std::uint8_t address, std::uint8_t value);
  Answer get_ids(pozyx::ByteView parameters) const;
  Answer positioning_ids_answer() const;
  Answer save(pozyx::ByteView parameters);
  Answer impulse(pozyx::ByteView parameters) const;
  // Functions that answer with success alone; false: bad parameters.
  bool write_message(pozyx::ByteView parameters);
  bool set_lights(pozyx::ByteView parameters);
  bool set_positioning_ids(pozyx::ByteView parameters);
  void start();
  const Known* known(pozyx::ByteView id) const;

  std::uint16_t label_;
  bool is_tag_;
  std::uint8_t firmware_, rates_, plen_, lights_{0};
  int flashes_{0};
  std::array<std::uint8_t, 256> memory_{};
  std::vector<Known> list_, saved_list_;
  std::vector<std::uint16_t> positioning_ids_, saved_positioning_ids_;
  std::map<std::uint8_t, pozyx::Bytes> flash_;  ///< whole registers, by their first address
  std::map<std::uint16_t, pozyx::RangeInfo> ranges_;
  std::vector<std::int16_t> impulse_;
  pozyx::Bytes tx_ = pozyx::Bytes(pozyx::k_tx_buffer), rx_ = pozyx::Bytes(pozyx::k_tx_buffer);
  std::size_t tx_size_{0};
  bool unread_{false};
};

}  // namespace anchord::sim
