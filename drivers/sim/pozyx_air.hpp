#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "drivers/sim/pozyx_device.hpp"

namespace anchord::sim {

/// One Pozyx device of the scenario: what it remembers, where it is, what it has under way.
struct PozyxStation {
  PozyxDevice device;
  TagSetup setup;  ///< of an anchor: that of the first tag, with whose radio and clock it was bought
  bool is_tag{};
  Eigen::Vector3d enu_m{0, 0, 0};  ///< of an anchor
  double bias_m{};                 ///< antenna delay
  Random random;
  double boot_s{0};
  double rx_full_until_s{0};   ///< how long a result waits for the message before it to be read
  std::uint64_t exchanges{0};  ///< ranges it tried, or had others try
  bool fresh{false};           ///< its newest range was not asked for yet
  std::uint64_t rounds{0};     ///< of continuous positioning: another number ends the one that runs
  std::vector<std::pair<std::uint16_t, std::uint32_t>> used{};  ///< anchors and mm of its newest position
  std::vector<Eigen::Vector3d> positions_m{};                   ///< newest last, for its filter
  double imu_s{0};                                              ///< of its newest inertial event
  bool asked_imu{false};                                        ///< a host has set a sensor mode
  std::optional<double> polling_since_s{};                      ///< its host does nothing but look for events
  double turned_s{0}, heading_rad{0};  ///< when its sensors were read last, and where the nose was
};

/// Every Pozyx device of a scenario and the radio between them: functions that use the air, whoever asks for
/// them, a host by wire or another device. The same seed, questions and instants give the same answers. Pure;
/// not thread-safe; time (seconds of the scenario) must not go back.
class PozyxAir {
 public:
  /// `where` tells how the aircraft that carries the tags flies.
  PozyxAir(std::shared_ptr<const Scenario> scenario, Whereabouts where);
  PozyxAir(const PozyxAir&) = delete;  // what is on the air refers to it
  PozyxAir& operator=(const PozyxAir&) = delete;

  const Scenario& scenario() const { return *scenario_; }
  PozyxStation& tag(NetworkId label);
  const PozyxStation* by_label(NetworkId label) const;

  void run_until(double now_s);
  /// Memory is lost, the clock begins anew.
  void restart(PozyxStation& station, double now_s);
  bool faulty(const PozyxStation& station, FaultKind kind, double now_s) const;

  pozyx::Bytes read(PozyxStation& self, std::uint8_t address, std::size_t n, double now_s, bool by_wire);
  bool write(PozyxStation& self, std::uint8_t address, pozyx::ByteView data, double now_s);
  /// asker  who sent the call by radio, and gets the result pushed when there is one; absent: its own wire
  PozyxDevice::Answer call(PozyxStation& self, std::uint8_t function, pozyx::ByteView parameters,
                           double now_s, PozyxStation* asker = nullptr);

 private:
  struct Pending {  ///< something on the air
    double at_s{};
    const PozyxStation* owner{};
    std::function<void(double)> done;
  };

  bool range(PozyxStation& self, pozyx::ByteView parameters, double now_s, PozyxStation* asker);
  bool discover(PozyxStation& self, pozyx::ByteView parameters, double now_s, PozyxStation* asker);
  bool calibrate(PozyxStation& self, pozyx::ByteView parameters, double now_s, PozyxStation* asker);
  bool position(PozyxStation& self, pozyx::ByteView parameters, double now_s, PozyxStation* asker);
  bool locate(PozyxStation& self, double at_s, Random& random);
  void position_for_ever(PozyxStation& self, double now_s);
  std::optional<pozyx::Bytes> position_data(PozyxStation& self, unsigned flags, std::size_t room,
                                            double now_s);
  bool blink(PozyxStation& self, pozyx::ByteView parameters, double now_s);

  bool send(PozyxStation& self, pozyx::ByteView parameters, double now_s);
  void broadcast(PozyxStation& self, std::uint8_t operation, const pozyx::Bytes& message, double now_s);
  void deliver(PozyxStation& other, PozyxStation& asker, std::uint8_t operation, const pozyx::Bytes& message,
               double now_s);
  /// Once the asker's host has read its receive buffer, or has had its time for it.
  void when_read(PozyxStation& asker, double at_s, const std::function<void(double)>& done);

  std::optional<Exchange> exchange(PozyxStation& from, PozyxStation& to, double at_s, Random& random);
  void store_range(PozyxStation& from, std::uint16_t to, const Exchange& exchange, double at_s);
  void after(const PozyxStation& owner, double at_s, std::function<void(double)> done);
  void inertial_event(PozyxStation& self, double now_s);
  void sense(PozyxStation& self, double now_s);
  PozyxStation* find(std::uint16_t id);
  Terminal terminal(const PozyxStation& station, double at_s) const;
  std::uint32_t clock_ms(const PozyxStation& station, double at_s) const;
  double air_s(const PozyxStation& station) const;
  double frame_s(const PozyxStation& station) const;

  std::shared_ptr<const Scenario> scenario_;
  Whereabouts where_;
  std::map<std::uint16_t, PozyxStation> stations_;  ///< by the id on their label
  std::vector<Pending> pending_;
  double now_s_{0};
};

}  // namespace anchord::sim
