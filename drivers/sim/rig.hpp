#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "drivers/sim/path.hpp"
#include "drivers/sim/scenario.hpp"

namespace anchord::sim {

/// A device that is being served.
struct ServedDevice {
  std::string name;
  std::string kind;     ///< pozyx, gnss
  std::string format;   ///< gnss: nmea, ubx, erb, llh, gpsd
  std::string address;  ///< as a device of the server: serial:/path or tcp://127.0.0.1:port
  std::string pty;      ///< now; another one after each plug
  std::string link;     ///< to the pty, the same all the time
  std::uint16_t tcp_port{};
  bool plugged{true};
};

struct RigOptions {
  std::string links_folder;  ///< for links of ptys without one of their own; must exist
  Whereabouts pilot{};       ///< who flies; absent: the path of the scenario
  UtcTime start{};           ///< of scenario time 0, unless the scenario says; zero: now
};

/// All devices of a scenario on their ports, in real time. One thread: the one that calls step().
class Rig {
 public:
  /// errors: of check(), and of ports that cannot be made
  static Result<std::unique_ptr<Rig>> open(std::shared_ptr<const Scenario> scenario, RigOptions options);
  ~Rig();
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  /// Waits until something is to be done, at most so long, and does it. `also`: a descriptor that ends the
  /// wait; -1: none.
  void step(int at_most_ms, int also = -1);
  double now_s() const;  ///< scenario time
  std::vector<ServedDevice> devices() const;
  /// Pulls or plugs one by hand, over what the scenario says. False: no such device.
  bool plug(const std::string& name, bool in);
  /// Ranges that have left a tag by its wire.
  std::uint64_t told_ranges(const std::string& name) const;
  /// Each time a device was pulled or plugged.
  void on_change(std::function<void(const ServedDevice&)> told);

 private:
  class Impl;
  explicit Rig(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace anchord::sim
