#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/sim/pozyx_device.hpp"

namespace anchord::sim {

/// A Pozyx tag as its USB port shows it, with every anchor of the scenario behind its radio: bytes and time
/// in, bytes out. The same seed and the same questions at the same instants give the same bytes. Pure; not
/// thread-safe; time (seconds of the scenario) must not go back.
class PozyxTag {
 public:
  /// tag  one of scenario.tags. `where` tells how the aircraft flies: the scenario's path, or another pilot.
  PozyxTag(std::shared_ptr<const Scenario> scenario, const TagSetup& tag, Whereabouts where);
  PozyxTag(const PozyxTag&) = delete;  // what is on the air refers to it
  PozyxTag& operator=(const PozyxTag&) = delete;

  void hear(std::string_view bytes, double now_s);
  /// What is due by now.
  std::string speak(double now_s);
  /// When something is due next; absent: nothing until it hears.
  std::optional<double> next_s() const;
  /// Power comes back after an unplugging: memory is lost, the clock begins anew.
  void power_up(double now_s);

  std::uint64_t exchanges() const { return exchanges_; }  ///< tried over the air
  /// Ranges the host was told: those whose info has left by the wire. Of these a host may lose only the one
  /// that is on the wire when the plug is pulled.
  std::uint64_t told() const { return told_; }
  int flashes(NetworkId id) const;  ///< times a host switched a light of this device on

 private:
  struct Pending {  ///< something on the air
    double at_s{};
    std::function<void(double)> done;
  };
  struct Reply {
    double at_s{};
    std::string bytes;
    bool range{false};  ///< info of a fresh range
  };

  void take(const pozyx::Command& command, double now_s);
  void say(std::string bytes, double now_s, bool range = false);
  pozyx::Bytes call(const pozyx::Command& command, double now_s);
  /// Functions that use the air; false: refused.
  bool start(std::uint8_t function, pozyx::ByteView parameters, double now_s);
  void range_local(std::uint16_t to, double now_s);
  bool discover(pozyx::ByteView parameters, double now_s);
  bool position(double now_s);
  PozyxDevice::Answer position_with_data(pozyx::ByteView parameters);
  bool send(pozyx::ByteView parameters, double now_s);
  void answer_remote(PozyxDevice& device, pozyx::Bytes message, double now_s);
  void remote_function(PozyxDevice& device, pozyx::ByteView message, double now_s);
  /// Once the host has read the receive buffer, or has had its time for it.
  void when_read(double at_s, double look_s, const std::function<void(double)>& done);
  std::optional<Exchange> exchange(PozyxDevice& from, PozyxDevice& to, double at_s);
  void store_range(PozyxDevice& from, std::uint16_t to, const Exchange& exchange, double at_s);
  void after(double at_s, std::function<void(double)> done);
  void run_until(double now_s);
  void update_sensors(double now_s);
  PozyxDevice* device(std::uint16_t id);
  Terminal terminal(const PozyxDevice& device, double at_s) const;
  std::uint32_t clock_ms(const PozyxDevice& device, double at_s) const;
  double air_s(const PozyxDevice& device) const;
  bool faulty(FaultKind kind, double now_s) const;

  std::shared_ptr<const Scenario> scenario_;
  TagSetup setup_;
  Whereabouts where_;
  Random random_;
  pozyx::Lines lines_;
  PozyxDevice self_;
  std::map<std::uint16_t, PozyxDevice> others_;
  std::map<std::uint16_t, double> bias_m_;
  std::deque<Reply> replies_;
  std::vector<Pending> pending_;
  pozyx::Bytes tx_ = pozyx::Bytes(100), rx_ = pozyx::Bytes(100);
  std::size_t tx_size_{0};
  bool rx_unread_{false};
  double rx_full_until_s_{0};
  double boot_s_{0};
  std::uint64_t exchanges_{0}, told_{0};
  bool fresh_{false};  ///< the newest range was not asked for yet
};

}  // namespace anchord::sim
