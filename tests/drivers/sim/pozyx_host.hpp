#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "drivers/pozyx/registers.hpp"
#include "drivers/pozyx/values.hpp"
#include "drivers/sim/pozyx_tag.hpp"

namespace anchord::sim {

using namespace pozyx;

/// A tag 0x6000 at the origin, anchors 0x6001..3 some 4 m away in the open; nothing is lost.
inline Scenario open_field() {
  Scenario scenario;
  scenario.seed = 3;
  scenario.world.anchors = {{{0x6001}, {4, 0, 0}}, {{0x6002}, {0, 4, 0}}, {{0x6003}, {-4, 0, 0}}};
  scenario.radio.loss_chance = 0;
  scenario.radio.zero_chance = 0;
  scenario.path.emplace_back();
  TagSetup tag;
  tag.id = {0x6000};
  tag.firmware = 0x13;
  tag.rates = 0x80;
  tag.plen = 0x0c;
  tag.lever_arm_m = {0, 0, 0};
  scenario.tags = {tag};
  return scenario;
}

/// A host with the patience of the maker's client: one question, its answer within 100 ms.
struct Host {
  explicit Host(Scenario s)
      : scenario(std::make_shared<const Scenario>(std::move(s))),
        air(std::make_shared<PozyxAir>(
            scenario, [path = FlightPath(scenario->path, scenario->speed_mps, scenario->loop)](
                          double t) { return path.at(t); })),
        tag(air, scenario->tags.at(0)) {}
  /// Of another tag on the same air.
  Host(const Host& first, std::size_t number)
      : scenario(first.scenario), air(first.air), tag(air, scenario->tags.at(number)), now_s(first.now_s) {}

  std::string ask(const std::string& question) {
    tag.receive(question + "\r", now_s);
    const auto due_s = tag.next_s();
    if (!due_s || *due_s > now_s + 0.1) return {};
    now_s = *due_s;
    std::string answer = tag.speak(now_s);
    all += answer;
    EXPECT_TRUE(answer.ends_with("\r\n")) << answer;
    answer.resize(answer.size() - 2);
    return answer;
  }
  /// Register 05 once one of these bits is set, or 0 after a while.
  int poll(std::uint8_t bits, double patience_s) {
    for (const double until_s = now_s + patience_s; now_s < until_s; now_s += 0.001) {
      const int events = parse_reply(ask("R,05,1"), 1).value()[0];
      if (events & bits) return events;
    }
    return 0;
  }
  RangeInfo info(const std::string& id) {
    const Bytes reply = parse_reply(ask("F,c7," + id + ",11"), 11).value();
    return range_info(ByteView(reply).subspan(1));
  }
  int range(const std::string& id) {
    ask("R,05,1");
    EXPECT_EQ(ask("F,b5," + id + ",1"), "D,01");
    return poll(event::func | event::err, 0.5);
  }

  std::shared_ptr<const Scenario> scenario;
  std::shared_ptr<PozyxAir> air;
  PozyxTag tag;
  double now_s{1.0};
  std::string all;
};

}  // namespace anchord::sim
