#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "core/types/base_station.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"
#include "drivers/link/byte_link.hpp"

namespace anchord::timing {
class TimeBase;
}

namespace anchord::device {

using link::Arrival;

/// What a device says it is; empty where it does not.
struct Identity {
  std::string model, firmware, serial;
  std::optional<NetworkId> network_id{};
  bool operator==(const Identity&) const = default;
};

/// How a device's own clock runs against ours.
struct ClockReading {
  double drift_ppm{};  ///< fast is positive
  double sigma_s{};    ///< of the newest stamp
  bool settled{};      ///< ten seconds of it were heard
  bool skewed{};       ///< it drifts more than a crystal can
  bool operator==(const ClockReading&) const = default;
};

/// One epoch of a rover as the status strip shows it; with fix none as well.
struct RoverStatus {
  UtcTime time{};
  FixClass fix{FixClass::none};
  std::optional<int> satellites{};
  std::optional<double> age_s{}, sigma_h_m{}, sigma_v_m{};
  std::optional<Wgs84> position{};
  std::optional<double> height_msl_m{}, hdop{};
};

/// Something the operator wants of the device: "identify", "reboot", "set_uwb", ...
struct Command {
  std::uint64_t id{};
  std::string name;
  std::string arguments_json;  ///< an object; empty = {}
};

/// Where a driver's results go. Rows come without mission: whoever records knows it.
class DriverOutput {
 public:
  virtual ~DriverOutput() = default;
  virtual void send(std::string_view bytes) = 0;  ///< to the device
  virtual void emit(Fix fix) = 0;
  virtual void emit(Range range) = 0;
  virtual void rover(const RoverStatus& status) = 0;
  virtual void identified(const Identity& identity) = 0;
  /// Of a device that stamps by a clock of its own.
  virtual void clock(const ClockReading& reading) { (void)reading; }
  /// Where the corrections of an NTRIP client come from.
  virtual void base(const BaseStation& station) { (void)station; }
  /// A good frame came: what the supervisor calls talking.
  virtual void heard() = 0;
  /// Bytes or rows not used. `reason` is of a small fixed set: it becomes a metric label.
  virtual void dropped(std::string_view reason, std::uint64_t n = 1) = 0;
  /// One line about what this connection sends that a person should act on, though it talks; empty: nothing
  /// any more. Without running numbers.
  virtual void notice(std::string_view text) { (void)text; }
  /// Why some of what it gives is left out beside better of the same kind, and what to do: an alarm. Empty:
  /// no longer.
  virtual void unused(std::string_view why) { (void)why; }
  /// Outcome of a command: a JSON value, or why not. Exactly once a command.
  virtual void answer(std::uint64_t command_id, Result<std::string> json) = 0;
  /// Corrections for rovers (RTCM), from an NTRIP client.
  virtual void corrections(std::string_view bytes) = 0;
  /// This connection is of no use (refused, not our device): close it and wait this long at least.
  virtual void hang_up(std::string_view why, std::int64_t wait_ns) = 0;
  /// The newest position of a rover, for casters that want to know where we are; absent without a fix.
  virtual std::optional<RoverStatus> rover_position() const = 0;
  /// UTC of steady instants.
  virtual timing::TimeBase& time() = 0;
  /// Which device of the recording this is: the name under which a receiver speaks to the time base.
  virtual std::uint16_t slot() const = 0;
};

/// What one kind of device's protocol does with its bytes. Pure: no port, no clock, no threads; the same
/// calls give the same output, which is what makes a recording replay byte for byte. Must bear any bytes.
class Driver {
 public:
  virtual ~Driver() = default;
  virtual void opened(const Arrival& now) = 0;
  virtual void bytes(std::string_view bytes, const Arrival& at) = 0;
  /// deadline() has passed.
  virtual void tick(const Arrival& now) { (void)now; }
  /// Steady time at which tick() is wanted; absent: not. Asked again after every call.
  virtual std::optional<std::int64_t> deadline_ns() const { return std::nullopt; }
  virtual void closed(const Arrival& now) { (void)now; }
  /// Answers through DriverOutput::answer, now or later; a command that cannot be done is answered too.
  virtual void command(const Command& command, const Arrival& now) = 0;
  /// Whether corrections of an NTRIP client are to be sent to it.
  virtual bool takes_corrections() const { return false; }
};

/// A device as the operator set it up. `options_json` is the object of its kind (gnss: format, latency_ms;
/// ntrip: mount, user, ...). Secrets are never in here: they come by file (`password_file`).
struct Settings {
  std::string id;    ///< UUID
  std::string kind;  ///< gnss, pozyx, ntrip
  std::string name;
  std::string address;
  std::string options_json{"{}"};
};

/// The drivers there are. errors: invalid_argument, naming the option.
Result<std::unique_ptr<Driver>> make_driver(const Settings& settings, DriverOutput& output);
/// Whether it could be started: its kind, address and options. errors: invalid_argument, naming what is
/// wrong.
Result<void> check_settings(const Settings& settings);

}  // namespace anchord::device
