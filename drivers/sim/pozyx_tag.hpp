#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/sim/pozyx_air.hpp"

namespace anchord::sim {

/// A Pozyx tag as its USB port shows it, with the other devices of the scenario behind its radio: bytes and
/// time in, bytes out. The same seed and the same questions at the same instants give the same bytes. Pure;
/// not thread-safe; time (seconds of the scenario) must not go back.
class PozyxTag {
 public:
  /// tag  one of scenario.tags. `where` tells how the aircraft flies: the scenario's path, or another pilot.
  /// Its radio is shared with nobody else who has a port.
  PozyxTag(std::shared_ptr<const Scenario> scenario, const TagSetup& tag, Whereabouts where);
  /// One of several tags that hear each other.
  PozyxTag(std::shared_ptr<PozyxAir> air, const TagSetup& tag);
  PozyxTag(const PozyxTag&) = delete;
  PozyxTag& operator=(const PozyxTag&) = delete;

  void receive(std::string_view bytes, double now_s);
  /// What is due by now.
  std::string speak(double now_s);
  /// When something is due next; absent: nothing until it hears.
  std::optional<double> next_s() const;
  /// Power comes back after an unplugging: memory is lost, the clock begins anew.
  void power_up(double now_s);
  /// A host opens the port: what another one left in it, half a line or an unread answer, is gone.
  void opened();

  std::uint64_t exchanges() const { return self_->exchanges; }  ///< tried over the air
  /// Ranges the host was told: those whose info has left by the wire. Of these a host may lose only the one
  /// that is on the wire when the plug is pulled.
  std::uint64_t told() const { return told_; }
  int flashes(NetworkId id) const;  ///< times a host switched a light of this device on

 private:
  struct Reply {
    double at_s{};
    std::string bytes;
    bool range{false};  ///< info of a fresh range
  };

  void take(const pozyx::Command& command, double now_s);
  void send(std::string bytes, double now_s, bool range = false);
  pozyx::Bytes call(const pozyx::Command& command, double now_s);

  std::shared_ptr<PozyxAir> air_;
  PozyxStation* self_;
  pozyx::Lines lines_{pozyx::Lines::End::carriage_return};
  std::deque<Reply> replies_;
  std::uint64_t told_{0};
};

}  // namespace anchord::sim
