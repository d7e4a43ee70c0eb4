#include "drivers/pozyx/unit.hpp"

#include <gtest/gtest.h>

#include <map>

#include "drivers/device/settings.hpp"
#include "tests/drivers/device/collect.hpp"
#include "tests/drivers/pozyx/simulated_wire.hpp"

namespace anchord::pozyx::unit_test {
namespace {

using device::test::Collect;
using record::EventKind;

/// The driver behind the server's own entrance, with a simulated tag on its wire.
struct Flight {
  explicit Flight(const std::string& options = "{}", sim::Scenario scenario = open_field())
      : pipeline(sink), wire(std::move(scenario)) {
    take(EventKind::added, device::to_json(device::Settings{"p", "pozyx", "", "serial:/dev/x", options}));
    take(EventKind::opened);
  }
  void take(EventKind kind, std::string_view payload = {}) {
    const link::Arrival at{UtcTime{1'700'000'000'000'000'000 + wire.now_ns}, wire.now_ns};
    const auto done = pipeline.take({kind, 1, at, payload});
    EXPECT_TRUE(done) << done.error().message;
    wire.send(std::exchange(sink.sent[1], {}));
  }
  void run(
      double seconds, const std::function<bool()>& done = [] { return false; }) {
    wire.send(std::exchange(sink.sent[1], {}));
    wire.run(
        seconds, done, [&] { return pipeline.deadline_ns(1); },
        [&](std::string_view bytes, std::int64_t) { take(EventKind::bytes, bytes); },
        [&](std::int64_t) { take(EventKind::tick); });
  }
  std::string ask(const std::string& name, const std::string& arguments = "{}") {
    const std::uint64_t id = ++commands;
    take(EventKind::command, device::to_json(device::Command{id, name, arguments}));
    run(120, [&] { return sink.answers.contains(id); });
    return sink.answers[id];
  }
  Collect sink;
  device::Pipeline pipeline;
  SimulatedWire wire;
  std::uint64_t commands{0};
};

TEST(PozyxUnit, FindsTheAnchorsByItselfAndRangesToThemInTurn) {
  Flight flight;
  flight.run(30);
  EXPECT_EQ(flight.sink.identities[1].model, "Pozyx tag 1.3");
  EXPECT_EQ(flight.sink.identities[1].network_id, NetworkId{0x6000});
  std::map<std::uint32_t, int> heard;
  for (const Range& range : flight.sink.ranges) {
    ++heard[range.anchor.value];
    EXPECT_EQ(range.tag.value, 0x6000u);
    EXPECT_NEAR(range.distance_m, 4.08, 0.25);
    ASSERT_TRUE(range.cir);
    EXPECT_EQ(range.cir->re_im.size(), 2 * 128u);
  }
  EXPECT_EQ(heard.size(), 3u);
  EXPECT_GT(flight.sink.ranges.size(), 700u);  // 6.81 Mbit/s, 1024 symbols: 13 ms of air and 12 questions
  EXPECT_TRUE(flight.sink.drops.empty()) << flight.sink.drops.begin()->first;
}

TEST(PozyxUnit, DoesNotTakeAnotherTagOfTheKitForAnAnchor) {
  sim::Scenario scenario = open_field();
  scenario.tags.push_back(scenario.tags[0]);
  scenario.tags[1].name = "other";
  scenario.tags[1].id = {0x6010};
  scenario.tags[1].lever_arm_m = {1, 0, 0};
  Flight flight(R"({"cir":"none"})", scenario);
  flight.run(5);
  EXPECT_NE(flight.ask("discover").find("0x6010"), std::string::npos) << "it is told, as what is in reach";
  flight.run(30);
  EXPECT_GT(flight.sink.ranges.size(), 100u);
  for (const Range& range : flight.sink.ranges) EXPECT_NE(range.anchor.value, 0x6010u);
}

TEST(PozyxUnit, StampsRangesByTheTagsOwnClock) {
  sim::Scenario scenario = open_field();
  scenario.tags[0].clock_drift_ppm = 40;
  Flight flight(R"({"anchors":["0x6001"],"cir":"none"})", scenario);
  flight.run(60);
  ASSERT_GT(flight.sink.ranges.size(), 1000u);
  double worst_s = 0;
  for (std::size_t i = 400; i < flight.sink.ranges.size(); ++i) {
    const Range& range = flight.sink.ranges[i];
    const double late_s = seconds_between(range.time, *range.received);
    worst_s = std::max(worst_s, std::abs(late_s));
  }
  EXPECT_LT(worst_s,
            0.01);  // a clock modelled wrongly by 40 ppm would be 2.4 ms off after a minute, and grow
}

TEST(PozyxUnit, GivesTheSameRowsWithTheSameBytes) {
  const auto rows = [] {
    Flight flight(R"({"anchor_anchor_s":1})");
    flight.run(10);
    return flight.sink.rows;
  };
  EXPECT_EQ(rows(), rows());
}

TEST(PozyxUnit, RangesBetweenAnchorsWhenAsked) {
  Flight flight(R"({"anchors":["0x6001","0x6002","0x6003"],"cir":"none","anchor_anchor_s":0.5})");
  flight.run(20);
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> pairs;
  for (const Range& range : flight.sink.ranges) {
    if (range.kind == RangeKind::anchor_anchor) ++pairs[{range.tag.value, range.anchor.value}];
  }
  EXPECT_EQ(pairs.size(), 3u);
  EXPECT_NE(flight.ask("range_between", R"({"from":"0x6001","to":"0x6003"})").find("distance_m"),
            std::string::npos);
}

TEST(PozyxUnit, DoesNotSlowDownForAnAbsentAnchor) {
  Flight present(R"({"anchors":["0x6001"],"cir":"none"})"),
      absent(R"({"anchors":["0x6001","0x7777"],"cir":"none"})");
  present.run(20);
  absent.run(20);
  EXPECT_GT(absent.sink.ranges.size(), 9 * present.sink.ranges.size() / 10);
  EXPECT_GT(absent.sink.drops["no_answer"], 10u);
}

TEST(PozyxUnit, StoresNoFailureValueAndCountsEach) {
  sim::Scenario scenario = open_field();
  scenario.radio.zero_chance = 0.2;
  scenario.faults = {{"tag", sim::FaultKind::stale, 10, 15}};
  Flight flight(R"({"anchors":["0x6001"],"cir":"none"})", scenario);
  flight.run(20);
  for (const Range& range : flight.sink.ranges) {
    EXPECT_GT(range.distance_m, 3.5);
    EXPECT_LT(range.distance_m, 4.5);
  }
  EXPECT_GT(flight.sink.drops["zero_distance"], 20u);
  EXPECT_GT(flight.sink.drops["stale_range"], 5u);
}

TEST(PozyxUnit, CarriesOnAfterAPulledPlugAndAnswersWhatWasAsked) {
  Flight flight(R"({"anchors":["0x6001"],"cir":"none"})");
  flight.run(5);
  const std::size_t before = flight.sink.ranges.size();
  flight.take(EventKind::command, device::to_json(device::Command{77, "discover", "{}"}));
  flight.take(EventKind::closed);
  EXPECT_EQ(flight.sink.answers[77], "error: the tag was unplugged");
  flight.wire.to_tag.clear();
  flight.wire.tag.power_up(flight.wire.at_s());
  flight.take(EventKind::opened);
  flight.run(5);
  EXPECT_GT(flight.sink.ranges.size(), before + 100);
}

TEST(PozyxUnit, HangsUpOnWhatIsNoPozyx) {
  sim::Scenario scenario = open_field();
  scenario.faults = {{"tag", sim::FaultKind::silence, 0, 1e5}};
  Flight flight("{}", scenario);
  flight.run(10);
  EXPECT_EQ(flight.sink.hung_up, "no Pozyx tag answers on this port");
  scenario.faults.clear();
  scenario.tags[0].firmware = 0x01;
  Flight old("{}", scenario);
  old.run(5);
  EXPECT_NE(old.sink.hung_up.find("older than 1.0"), std::string::npos);
}

TEST(PozyxUnit, DoesWhatTheOperatorAsks) {
  Flight flight;
  flight.run(3);
  EXPECT_NE(flight.ask("get_uwb").find("\"channel\":5"), std::string::npos);
  EXPECT_EQ(flight.ask("reboot"), "{}");
  EXPECT_NE(flight.ask("discover").find("0x6001"), std::string::npos);
  EXPECT_NE(flight.ask("get_uwb").find("\"preamble_symbols\":1024"), std::string::npos);
  const std::string set = flight.ask(
      "set_uwb",
      R"({"channel":2,"rate_kbps":850,"preamble_symbols":512,"devices":["0x6001","0x6002","0x6003"]})");
  EXPECT_NE(set.find("\"all\":true"), std::string::npos) << set;
  const std::string pushed = flight.ask(
      "push_positions", R"({"positions":[{"network_id":"0x6001","x_m":1.5,"y_m":-2,"z_m":2.25}]})");
  EXPECT_NE(pushed.find("\"all\":true"), std::string::npos) << pushed;
  EXPECT_NE(flight.ask("fly").find("error: a pozyx device knows"), std::string::npos);
  EXPECT_NE(flight.ask("set_uwb", R"({"channel":6})").find("error: channel 6"), std::string::npos);
  EXPECT_NE(flight.ask("push_positions", "{}").find("error: positions"), std::string::npos);
  const std::size_t before = flight.sink.ranges.size();
  flight.run(3);
  EXPECT_GT(flight.sink.ranges.size(), before + 30) << "ranging goes on with the new settings";
}

TEST(PozyxUnit, TellsWhichAnchorHasOtherSettingsThanTheTag) {
  Flight flight(R"({"anchors":["0x6001","0x6002","0x6666"]})");
  flight.run(3);
  const std::string told = flight.ask("get_uwb", R"({"devices":true})");
  EXPECT_NE(told.find(R"({"done":true,"network_id":"0x6001"},{"done":true,"network_id":"0x6002"})"),
            std::string::npos)
      << told;
  EXPECT_NE(told.find(R"({"done":false,"network_id":"0x6666","why":"0x6666 does not answer)"),
            std::string::npos)
      << told;
  // The tag alone goes to another channel: nobody is heard there.
  EXPECT_NE(flight.ask("set_uwb", R"({"channel":2,"all":false})").find("\"channel\":2"), std::string::npos);
  const std::string alone = flight.ask("get_uwb", R"({"devices":true})");
  EXPECT_EQ(alone.find("\"done\":true"), std::string::npos) << alone;
  EXPECT_EQ(flight.ask("get_uwb").find("devices"), std::string::npos);
}

TEST(PozyxUnit, IdentifiesATagOrAnAnchorByItsLights) {
  Flight flight;
  flight.run(3);
  const std::string tag = flight.ask("identify");
  EXPECT_NE(tag.find("\"firmware\":\"1.3\""), std::string::npos) << tag;
  EXPECT_EQ(flight.wire.tag.flashes({0x6000}), 3);
  EXPECT_EQ(flight.wire.tag.flashes({0x6002}), 0);
  const std::string anchor = flight.ask("identify", R"({"network_id":"0x6002"})");
  EXPECT_NE(anchor.find("\"lights\":\"blinked\""), std::string::npos) << anchor;
  EXPECT_EQ(flight.wire.tag.flashes({0x6000}), 3);
  EXPECT_EQ(flight.wire.tag.flashes({0x6002}), 3);
  EXPECT_NE(flight.ask("identify", R"({"network_id":"0x6666"})").find("does not answer"), std::string::npos);
  const std::size_t before = flight.sink.ranges.size();
  flight.run(3);
  EXPECT_GT(flight.sink.ranges.size(), before + 30) << "ranging goes on";
}

TEST(PozyxUnit, ARebootWhoseUsbPortVanishesIsDone) {
  Flight flight(R"({"anchors":["0x6001"],"cir":"none"})");
  flight.run(3);
  flight.take(EventKind::command, device::to_json(device::Command{9, "reboot", "{}"}));
  flight.run(0.5);
  EXPECT_FALSE(flight.sink.answers.contains(9));
  flight.take(EventKind::closed);
  EXPECT_EQ(flight.sink.answers[9], "{}");
}

TEST(PozyxUnit, TellsThatTheTagsClockIsNoneAndThatAnotherTagsIsGood) {
  const auto reading_of = [](double drift_ppm) {
    sim::Scenario scenario = open_field();
    scenario.tags[0].clock_drift_ppm = drift_ppm;
    Flight flight(R"({"anchors":["0x6001"],"cir":"none"})", scenario);
    flight.run(60);
    return flight.sink.clocks[1];
  };
  const auto good = reading_of(60), bad = reading_of(600), awful = reading_of(-4000);
  EXPECT_FALSE(good.skewed);
  EXPECT_TRUE(good.settled);
  EXPECT_NEAR(good.drift_ppm, 60, 20);  // stamps of a millisecond over a minute
  EXPECT_TRUE(bad.skewed);
  EXPECT_NEAR(bad.drift_ppm, 600, 20);
  EXPECT_TRUE(awful.skewed);
}

TEST(PozyxUnit, RefusesSettingsItDoesNotKnow) {
  Collect sink;
  device::Pipeline pipeline(sink);
  for (const char* options :
       {R"({"cir":"all"})", R"({"anchors":["x"]})", R"({"uwb":{"channel":9}})", R"({"speed":1})"}) {
    const std::string settings =
        device::to_json(device::Settings{"p", "pozyx", "", "serial:/dev/x", options});
    EXPECT_FALSE(pipeline.take({EventKind::added, 1, {}, settings})) << options;
  }
}

}  // namespace
}  // namespace anchord::pozyx::unit_test
