#include "drivers/sim/scenario.hpp"

#include <set>

namespace anchord::sim {
namespace {

bool positive(double value) { return value > 0 && value < 1e6; }  // false for NaN

}  // namespace

RadioOptions scenario_radio() {
  RadioOptions radio;
  // Depths read off the shape of Fig 8.4a; the figure's own numbers are relative to each test's minimum.
  radio.turn_lobe_db = 6;
  radio.height_lobe = true;
  radio.level_bias_share = 0.25;
  return radio;
}

Scenario demonstration_scenario() {
  Scenario scenario;
  scenario.world = demonstration_world();
  scenario.radio = scenario_radio();
  scenario.path = ring_path({0, 0}, {scenario.world.length_m, scenario.world.width_m}, 5.0, {3.5, 9.0, 14.0});
  scenario.speed_mps = 4;
  scenario.tags.emplace_back();
  scenario.rovers.emplace_back();
  return scenario;
}

Result<void> check(const Scenario& scenario) {
  const auto refuse = [](std::string why) { return make_error(Errc::invalid_argument, std::move(why)); };
  if (scenario.path.empty()) return refuse("the path has no points");
  if (!positive(scenario.speed_mps)) return refuse("the speed must be positive");
  if (scenario.world.anchors.empty()) return refuse("the world has no anchors");
  std::set<NetworkId> ids;
  std::set<std::string> names;
  for (const WorldAnchor& anchor : scenario.world.anchors) {
    if (anchor.id.value == 0 || anchor.id.value > 0xffff)
      return refuse("anchor id " + to_string(anchor.id) + " is not in 0x0001..0xffff");
    if (!ids.insert(anchor.id).second) return refuse("anchor " + to_string(anchor.id) + " occurs twice");
  }
  for (const TagSetup& tag : scenario.tags) {
    if (!ids.insert(tag.id).second) return refuse("device id " + to_string(tag.id) + " occurs twice");
    if (!names.insert(tag.name).second) return refuse("two devices have the name " + tag.name);
    if (tag.range_s && !positive(*tag.range_s)) return refuse("range_s of " + tag.name + " must be positive");
  }
  for (const RoverSetup& rover : scenario.rovers) {
    if (!names.insert(rover.name).second) return refuse("two devices have the name " + rover.name);
    if (!positive(rover.rate_hz) || rover.rate_hz > 100)
      return refuse("rate_hz of " + rover.name + " must be in 0..100");
  }
  for (const Fault& fault : scenario.faults) {
    if (!names.contains(fault.device)) return refuse("a fault names an unknown device: " + fault.device);
  }
  return boost::outcome_v2::success();
}

const Fault* fault_at(const Scenario& scenario, std::string_view device, FaultKind kind, double time_s) {
  for (const Fault& fault : scenario.faults) {
    if (fault.kind == kind && fault.device == device && time_s >= fault.from_s && time_s < fault.until_s)
      return &fault;
  }
  return nullptr;
}

}  // namespace anchord::sim
