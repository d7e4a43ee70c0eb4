#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "drivers/pozyx/cir_record.hpp"
#include "drivers/pozyx/conversation.hpp"
#include "drivers/pozyx/values.hpp"

namespace anchord::pozyx {

/// What is read of the impulse response after a range: rate against features.
enum class CirRead : std::uint8_t {
  none,    ///< distance and RSS only
  window,  ///< 128 taps from 672 (first path and 60 ns of echoes) and 32 of noise: four questions
  whole,   ///< all 1016 or 992 taps: 21 questions
};

/// One try to range.
struct Ranging {
  RangeFault fault{RangeFault::none};  ///< a success that is none
  std::string failure;                 ///< metric label of a failure; empty: info is there
  RangeInfo info{};
  std::int64_t seen_ns{};  ///< steady time of the event that ended it
  bool good() const { return failure.empty() && fault == RangeFault::none; }
};

/// Outcome for one device of something done to several.
struct DeviceOutcome {
  std::uint16_t id{};
  bool done{};
  std::string why;  ///< of a failure
};
struct Applied {
  bool all{};          ///< done and verified everywhere
  bool rolled_back{};  ///< not all: the old settings are back and verified where they were changed
  std::vector<DeviceOutcome> devices;
};

/// What a host does with a Pozyx tag, each a script over its conversation. pozyx-serial.md sections 5 to 8.
/// One script at a time.
class Tag {
 public:
  explicit Tag(Conversation& wire) : wire_(wire) {}
  Tag(const Tag&) = delete;
  Tag& operator=(const Tag&) = delete;

  Script<Result<TagIdentity>> identify();
  /// Ranges once to a device. Never an error of the wire without `failure` saying so.
  Script<Ranging> range(std::uint16_t id);
  /// Of the last frame received: right after the range, before anything else goes over the air.
  Script<Result<CirRecord>> read_cir(CirRead what);
  /// Devices in the list after one discovery; those found are added. Missing ones may only have been missed.
  Script<Result<std::vector<std::uint16_t>>> discover(std::uint8_t type, bool clear_first);
  Script<Result<std::vector<std::uint16_t>>> known_devices();
  Script<Result<UwbSettings>> uwb();
  /// This tag alone, verified.
  Script<Result<UwbSettings>> set_uwb(UwbSettings settings);
  /// The others first, then this tag, then all verified; if one is not, those changed go back.
  Script<Result<Applied>> set_uwb_everywhere(UwbSettings settings, std::vector<std::uint16_t> others);
  /// Clears the tag's list, adds the anchors with their positions, verifies each; then each anchor's own
  /// position registers, verified. save: keeps the list in flash.
  Script<Result<Applied>> push_positions(std::vector<DeviceInfo> devices, bool save);
  Script<Result<DeviceInfo>> stored_position(std::uint16_t id);
  /// Whether the device list has it as a tag. No public source says that a discovery marks what it finds;
  /// where it does not, a tag is taken for an anchor.
  Script<bool> listed_as_tag(std::uint16_t id);
  /// Distance between two other devices, this tag only relays. Never an error of the wire without `failure`.
  Script<Ranging> range_between(std::uint16_t from, std::uint16_t to);
  Script<Result<void>> set_sensors_mode(std::uint8_t mode);
  Script<Result<std::optional<double>>> heading_deg();
  Script<Result<void>> reset();
  /// Three flashes of the lights of this tag, or of another device, so that people see which one it is: 1.2
  /// s. The lights are the system's again afterwards.
  Script<Result<void>> blink(std::optional<std::uint16_t> other);

  Script<Result<Bytes>> remote_read(std::uint16_t id, std::uint8_t address, std::size_t n);
  Script<Result<void>> remote_write(std::uint16_t id, std::uint8_t address, Bytes data);
  /// Result without the remote status byte.
  Script<Result<Bytes>> remote_call(std::uint16_t id, std::uint8_t function, Bytes parameters,
                                    std::size_t result_bytes);
  const UwbSettings& settings() const { return settings_; }  ///< as last read

 private:
  /// Events once one of `bits` or ERR is set; 0 when none came in time.
  Script<Result<std::uint8_t>> poll(std::uint8_t bits, std::int64_t patience_ns);
  Script<Result<void>> light(std::optional<std::uint16_t> other, bool on);
  Script<Result<void>> set_light_control(std::optional<std::uint16_t> other, std::uint8_t config);
  Script<Result<void>> transmit(std::uint16_t id, std::uint8_t operation, Bytes message);
  Script<Result<Bytes>> receive(std::uint16_t id, std::size_t n);
  Script<Result<void>> write_air(UwbSettings settings);
  Script<Result<void>> set_remote_uwb(std::uint16_t id, UwbSettings settings);
  Script<std::string> failure_of(std::uint8_t events);

  Conversation& wire_;
  UwbSettings settings_{};
  bool events_clear_{false};  ///< no event of an earlier ranging can be pending
  std::map<std::uint16_t, RangeInfo> newest_;
  std::map<std::pair<std::uint16_t, std::uint16_t>, RangeInfo> newest_between_;
  std::uint8_t sensors_mode_{0}, calib_status_{0};
  std::int64_t calib_read_ns_{0};
};

}  // namespace anchord::pozyx
