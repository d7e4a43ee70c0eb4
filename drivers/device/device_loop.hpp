#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "drivers/device/base_watch.hpp"
#include "drivers/device/bounds.hpp"
#include "drivers/device/supervisor.hpp"
#include "drivers/port/driver.hpp"

namespace boost::asio {
class io_context;
}
namespace anchord::record {
class Recorder;
}

namespace anchord::device {

/// Everything known of one device at one moment.
struct DeviceState {
  Settings settings;
  Phase phase{Phase::lost};
  std::string reason;        ///< why it is not talking; while it talks, what is wrong with what it says
  std::string too_many_ids;  ///< what is wrong with the ids it sends, and what to do; empty: nothing
  std::string moved_base;  ///< what became of the base behind its corrections in this flight; empty: nothing
  std::string unused;  ///< why what it gives is left out beside another's, and what to do; empty: it is used
  std::string conflict;  ///< two devices on one port, or one identity on two devices; empty: none
  double in_phase_s{0};
  std::optional<UtcTime> last_seen{};
  Identity identity;
  std::optional<RoverStatus> rover{};
  std::optional<ClockReading> clock{};  ///< of this connection
  std::optional<BaseStation> base{};    ///< of this connection
  std::uint64_t bytes_in{0}, bytes_out{0}, frames{0}, fixes{0}, ranges{0}, opened{0}, lost{0};
  std::map<std::string, std::uint64_t> dropped;  ///< by reason
  double rows_per_s{0};                          ///< over the last five seconds
  std::uint64_t recorded{0};                     ///< bytes of it that went to the recording
};

/// How the server's clocks stand.
struct ClockState {
  bool from_receiver{false};
  std::optional<double> system_offset_s{};
  double sigma_s{0};
  std::string skew;  ///< one line when one of them, or a device's, is wrong; empty: none
};

/// Who hears of rows and changes. Called on the io thread; must not block.
class DeviceListener {
 public:
  virtual ~DeviceListener() = default;
  virtual void fix(const std::string& device, const Fix& fix) = 0;
  virtual void range(const std::string& device, const Range& range) = 0;
  virtual void changed(const std::string& device) = 0;  ///< phase, identity or conflict
  virtual void answer(const std::string& device, std::uint64_t command, const Result<std::string>& json) = 0;
};

struct LoopOptions {
  NoiseLimits noise{};
  SupervisorOptions supervisor{};
  std::int64_t presence_poll_ms = 500;  ///< of serial ports that are gone: by-id names come with the plug
  std::uint64_t seed = 1;               ///< of the jitter
};

/// The devices of one server on one io_context: links, supervisors and timers round a Pipeline. All that
/// reaches the pipeline is recorded first. Everything here belongs to the thread that runs the io_context.
class DeviceLoop {
 public:
  /// recorder: may be null (nothing is recorded). It and the listener outlive the loop.
  DeviceLoop(boost::asio::io_context& io, record::Recorder* recorder, DeviceListener& listener,
             const LoopOptions& options = {});
  ~DeviceLoop();
  DeviceLoop(const DeviceLoop&) = delete;
  DeviceLoop& operator=(const DeviceLoop&) = delete;

  /// errors: invalid_argument (address, kind, options), conflict (id or address in use already)
  Result<void> add(const Settings& settings);
  Result<void> remove(const std::string& id);                           ///< not_found
  Result<void> command(const std::string& id, const Command& command);  ///< not_found, link_lost
  void record_into(const std::optional<MissionId>& mission);

  /// Another recorder, or none; it hears of the devices there are.
  void record_to(record::Recorder* recorder);

  std::vector<DeviceState> devices() const;
  std::optional<DeviceState> device(const std::string& id) const;
  ClockState clock() const;
  /// Of a listening link.
  std::uint16_t port(const std::string& id) const;

 private:
  class Impl;
  std::shared_ptr<Impl> impl_;
};

}  // namespace anchord::device
