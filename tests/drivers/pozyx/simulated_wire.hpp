#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "drivers/sim/pozyx_tag.hpp"

namespace anchord::pozyx {

/// A simulated tag and whoever talks to it, in simulated time: every byte, no port.
class SimulatedWire {
 public:
  explicit SimulatedWire(sim::Scenario s)
      : scenario(std::make_shared<const sim::Scenario>(std::move(s))),
        tag(scenario, scenario->tags.at(0),
            [path = sim::FlightPath(scenario->path, scenario->speed_mps, scenario->loop)](double t) {
              return path.at(t);
            }) {}

  void send(std::string_view bytes) { to_tag += bytes; }

  /// Runs until `done` or for so long. `receive` and `tick` are the host's; times in steady ns.
  void run(double seconds, const std::function<bool()>& done,
           const std::function<std::optional<std::int64_t>()>& deadline,
           const std::function<void(std::string_view, std::int64_t)>& receive,
           const std::function<void(std::int64_t)>& tick) {
    const std::int64_t end_ns = now_ns + static_cast<std::int64_t>(seconds * 1e9);
    while (!done() && now_ns < end_ns) {
      if (!to_tag.empty()) tag.receive(std::exchange(to_tag, {}), at_s());
      std::int64_t next_ns = end_ns;
      if (const auto due = tag.next_s())
        next_ns = std::min(next_ns, std::max(now_ns, static_cast<std::int64_t>(*due * 1e9) + 1));
      if (const auto due = deadline()) next_ns = std::min(next_ns, std::max(now_ns, *due));
      now_ns = next_ns;
      const std::string bytes = tag.speak(at_s());
      log += bytes;
      if (!bytes.empty()) receive(bytes, now_ns);
      if (const auto due = deadline(); due && *due <= now_ns) tick(now_ns);
    }
  }
  double at_s() const { return static_cast<double>(now_ns) * 1e-9; }

  std::shared_ptr<const sim::Scenario> scenario;
  sim::PozyxTag tag;
  std::string to_tag, log;
  std::int64_t now_ns{1'000'000'000};
};

/// The tag 0x6000 at the origin, anchors 0x6001..3 some 4 m away in the open; nothing is lost by chance.
inline sim::Scenario open_field() {
  sim::Scenario scenario;
  scenario.seed = 3;
  scenario.world.anchors = {{{0x6001}, {4, 0, 0}}, {{0x6002}, {0, 4, 0}}, {{0x6003}, {-4, 0, 0}}};
  scenario.radio.loss_chance = 0;
  scenario.radio.zero_chance = 0;
  scenario.path.emplace_back();
  sim::TagSetup tag;
  tag.id = {0x6000};
  tag.firmware = 0x13;
  tag.lever_arm_m = {0, 0, 0};
  scenario.tags = {tag};
  return scenario;
}

}  // namespace anchord::pozyx
