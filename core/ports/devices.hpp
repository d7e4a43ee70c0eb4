#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/types/base_station.hpp"
#include "core/types/document.hpp"
#include "core/types/fix.hpp"
#include "core/types/range.hpp"

namespace anchord {

/// A device as the operator set it up.
struct DeviceConfig {
  Uuid id{};
  std::string kind;  ///< gnss, pozyx, ntrip
  std::string name;
  std::string address;     ///< serial:..., tcp://..., tcp-listen://..., udp://...
  Document options{"{}"};  ///< object of its kind: drivers/device/make_driver
  bool enabled{true};
  std::uint64_t version{1};  ///< for ETag
};

/// ... and how it stands.
struct DeviceReport {
  DeviceConfig config;
  std::string state{"off"};  ///< off, lost, found, open, talking, silent
  std::string reason;        ///< why it is not talking, or what is wrong with what it says, one line
  std::string conflict;      ///< two devices on one port, or one identity on two
  double in_state_s{};
  std::optional<UtcTime> last_seen{};
  std::string model, firmware, serial;
  std::optional<NetworkId> network_id{};
  std::uint64_t bytes_in{}, bytes_out{}, frames{}, fixes{}, ranges{}, opened{}, lost{};
  double rows_per_s{};
  std::map<std::string, std::uint64_t> dropped;  ///< by reason
  struct Rover {
    UtcTime time{};
    FixClass fix{FixClass::none};
    std::optional<int> satellites{};
    std::optional<double> age_s{}, sigma_h_m{}, sigma_v_m{};
  };
  std::optional<Rover> rover{};
  /// Of a device that stamps by a clock of its own: how that runs against ours.
  struct Clock {
    double drift_ppm{};  ///< fast is positive
    double sigma_s{};    ///< of its stamps
    bool settled{};      ///< ten seconds of it were heard
    bool skewed{};       ///< beyond what a crystal does: its stamps cannot be trusted
  };
  std::optional<Clock> clock{};
  std::optional<BaseStation> base{};  ///< of an NTRIP client: where its corrections come from
};

/// Whose clock the stamps come from.
struct DeviceClock {
  bool from_receiver{};
  std::optional<double> system_offset_s{};  ///< system clock minus UTC of the receiver
  double sigma_s{};
  std::string skew;  ///< one line when the system clock, or a device's, is wrong; empty: none
};

/// Something that could be a device.
struct DiscoveredDevice {
  std::string address;
  std::string kind;      ///< empty: nothing known spoke
  std::string evidence;  ///< what was heard, or why it could not be opened
  bool configured{};     ///< is one of ours already
};

/// What the devices of this server may be asked. Thread-safe; blocks for at most a few seconds. errors:
/// not_found, conflict (version moved on; address in use), invalid_argument (names the field), link_lost,
/// unsupported, storage_unavailable.
class DeviceControl {
 public:
  virtual ~DeviceControl() = default;
  virtual std::vector<DeviceReport> devices() = 0;
  virtual Result<DeviceReport> device(const Uuid& id) = 0;
  virtual Result<DeviceReport> add(DeviceConfig config) = 0;  ///< gives it its id
  virtual Result<DeviceReport> change(DeviceConfig config, std::uint64_t expected_version) = 0;
  virtual Result<void> remove(const Uuid& id, std::uint64_t expected_version) = 0;
  /// Answer of the device, a JSON value.
  virtual Result<std::string> act(const Uuid& id, std::string_view action,
                                  std::string_view arguments_json) = 0;
  /// Looks and listens at every port; takes some seconds.
  virtual std::vector<DiscoveredDevice> discover() = 0;
  virtual std::vector<DiscoveredDevice> discovered() = 0;  ///< by the last discover()
  virtual DeviceClock clock() = 0;
  /// Rows of devices belong to this mission from now on; absent: to none, and only the raw recording has
  /// them.
  virtual void record_into(const std::optional<MissionId>& mission) = 0;
  virtual std::optional<MissionId> recording_into() = 0;
  /// Why raw bytes are not being recorded; empty while they are, or while there is no device.
  virtual std::string recorder_failure() = 0;
  /// Devices that are kept and could not be started, with why and what to do, one line; empty: none.
  virtual std::string not_started() { return {}; }
};

/// Rows of devices, of each kind in the order of their arrival.
struct DeviceBatch {
  std::vector<Fix> fixes;
  std::vector<Range> ranges;
  std::size_t size() const { return fixes.size() + ranges.size(); }
  bool empty() const { return size() == 0; }
};

/// Who takes the rows of devices: first for the live flight, then to be kept. The two come from a thread
/// each, so that a flight never waits for a disk.
class DeviceRows {
 public:
  virtual ~DeviceRows() = default;
  /// Never waits for the database.
  virtual void live(const DeviceBatch& batch) = 0;
  /// Blocks on the database. After an error the same batch may come again.
  virtual Result<void> store(const DeviceBatch& batch) = 0;
};

}  // namespace anchord
