#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/time.hpp"
#include "drivers/sim/impulse.hpp"
#include "drivers/sim/path.hpp"
#include "drivers/sim/radio.hpp"
#include "drivers/sim/world.hpp"

namespace anchord::sim {

/// What goes wrong with one device between two instants of the scenario.
enum class FaultKind : std::uint8_t {
  unplug,       ///< the port vanishes and comes back
  garbage,      ///< bytes of noise between and inside the frames
  silence,      ///< the device hears and says nothing
  fix_loss,     ///< rover: no position
  fix_float,    ///< rover: ambiguities lost, float position
  late,         ///< tag: every answer comes 150 ms late, beyond the patience of the maker's client
  stale,        ///< tag: ranging says success and the range info stays the one before, or 167772160 mm
  zero,         ///< tag: ranging says success with 0 mm
  no_event,     ///< tag: ranging never ends
  refuse,       ///< tag: functions are refused, with short answers
  remote_deaf,  ///< tag: devices answer ranging, not remote questions
};
inline constexpr auto k_fault_words = enum_table<FaultKind>({{"unplug", FaultKind::unplug},
                                                             {"garbage", FaultKind::garbage},
                                                             {"silence", FaultKind::silence},
                                                             {"fix_loss", FaultKind::fix_loss},
                                                             {"fix_float", FaultKind::fix_float},
                                                             {"late", FaultKind::late},
                                                             {"stale", FaultKind::stale},
                                                             {"zero", FaultKind::zero},
                                                             {"no_event", FaultKind::no_event},
                                                             {"refuse", FaultKind::refuse},
                                                             {"remote_deaf", FaultKind::remote_deaf}});
struct Fault {
  std::string device;  ///< name of a tag or rover of the scenario
  FaultKind kind{};
  double from_s{}, until_s{};
};

/// A Pozyx tag on its own pty.
struct TagSetup {
  std::string name = "tag";
  NetworkId id{0x6e01};
  Eigen::Vector3d lever_arm_m{0.12, 0.0, -0.28};  ///< from the GNSS antenna: forward, left, up
  std::uint8_t firmware = 0x11;
  std::uint8_t plen = 0x08;         ///< register 1e: 1024 symbols
  std::uint8_t rates = 0x82;        ///< register 1d: 6.81 Mbit/s, PRF 64
  double clock_drift_ppm = 12;      ///< of its own millisecond clock
  double reply_s = 0.001;           ///< one USB frame between a question and its answer
  std::optional<double> range_s{};  ///< air time of one exchange; absent: from the radio settings
  std::string link;                 ///< path of a symbolic link to the pty; empty: none
};

/// Its own, not gnss::Protocol: the simulator shares nothing with the decoders that it tests.
enum class RoverFormat : std::uint8_t { nmea, ubx, erb, llh, gpsd };
inline constexpr auto k_rover_format_words = enum_table<RoverFormat>({{"nmea", RoverFormat::nmea},
                                                                      {"ubx", RoverFormat::ubx},
                                                                      {"erb", RoverFormat::erb},
                                                                      {"llh", RoverFormat::llh},
                                                                      {"gpsd", RoverFormat::gpsd}});
constexpr std::string_view to_string(RoverFormat format) { return k_rover_format_words.word(format); }
enum class RoverPort : std::uint8_t { pty, tcp };
inline constexpr auto k_rover_port_words =
    enum_table<RoverPort>({{"pty", RoverPort::pty}, {"tcp", RoverPort::tcp}});

/// An RTK receiver.
struct RoverSetup {
  std::string name = "rover";
  RoverFormat format{RoverFormat::nmea};
  RoverPort port{RoverPort::tcp};
  std::uint16_t tcp_port{};  ///< 0: the system chooses
  double rate_hz = 10;
  double delay_s = 0.04;                         ///< from the epoch to its bytes
  Eigen::Vector3d sigma_m{0.010, 0.010, 0.018};  ///< RTK fixed, and what it states
  Eigen::Vector3d float_sigma_m{0.25, 0.25, 0.45};
  Eigen::Vector3d base_error_m{0, 0, 0};  ///< of the base station's coordinates: shifts everything
  std::string link;
};

/// Everything a simulation is made of. docs/formats.md has the file.
struct Scenario {
  std::string name = "demonstration";
  std::uint64_t seed = 1;
  std::optional<UtcTime> start{};  ///< of scenario time 0; absent: when it is started
  World world;
  RadioOptions radio;
  ImpulseOptions impulse;
  std::vector<PathPoint> path;
  double speed_mps = 2;
  bool loop = true;
  std::vector<TagSetup> tags;
  std::vector<RoverSetup> rovers;
  std::vector<Fault> faults;
};

/// The radio settings of a scenario's kit: patterns of Fig 8.4 and 8.5 on, a quarter of the level bias left.
RadioOptions scenario_radio();

/// The demonstration: demonstration_world(), three rings, one tag, one NMEA rover on TCP.
Scenario demonstration_scenario();

/// First reason why it cannot run: no path, no anchors, a name twice, a rate or speed that is not positive.
Result<void> check(const Scenario& scenario);

/// The fault of this kind that holds `device` at an instant, if any.
const Fault* fault_at(const Scenario& scenario, std::string_view device, FaultKind kind, double time_s);

}  // namespace anchord::sim
