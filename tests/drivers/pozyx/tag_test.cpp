#include "drivers/pozyx/tag.hpp"

#include <gtest/gtest.h>

#include "tests/drivers/pozyx/simulated_wire.hpp"

namespace anchord::pozyx::tag_test {
namespace {

/// Runs scripts of one tag against the simulated one.
struct Host {
  explicit Host(sim::Scenario scenario = open_field())
      : wire(std::move(scenario)), talk([this](std::string_view bytes) { wire.send(bytes); }), tag(talk) {
    talk.set_now(wire.now_ns);
  }
  template <class T>
  T run(Script<T> script, double patience_s = 30) {
    std::optional<T> out;
    auto outer = keep(std::move(script), out);
    talk.set_now(wire.now_ns);
    outer.start();
    wire.run(
        patience_s, [&] { return out.has_value(); }, [&] { return talk.deadline_ns(); },
        [&](std::string_view bytes, std::int64_t now) { talk.bytes(bytes, now); },
        [&](std::int64_t now) { talk.tick(now); });
    if (outer.done()) outer.rethrow();
    if (!out) throw std::runtime_error("the script did not end");
    return std::move(*out);
  }
  template <class T>
  static Script<int> keep(Script<T> script, std::optional<T>& out) {
    T value = co_await script;
    out.emplace(std::move(value));
    co_return 0;
  }
  void at(double seconds) { wire.now_ns = static_cast<std::int64_t>(seconds * 1e9); }

  SimulatedWire wire;
  Conversation talk;
  Tag tag;
};

sim::Scenario with_fault(sim::FaultKind kind, double from_s = 10, double until_s = 20) {
  sim::Scenario scenario = open_field();
  scenario.faults = {{"tag", kind, from_s, until_s}};
  return scenario;
}

TEST(PozyxTag, SaysWhatItIs) {
  Host host;
  ASSERT_TRUE(host.run(host.talk.open()));
  const auto identity = host.run(host.tag.identify());
  ASSERT_TRUE(identity);
  EXPECT_EQ(identity.value().id, 0x6000);
  EXPECT_EQ(identity.value().firmware_text(), "1.3");
  EXPECT_EQ(identity.value().model(), "Pozyx tag 1.3");
  EXPECT_EQ(host.tag.settings().preamble_symbols, 1024);
}

TEST(PozyxTag, RangesReadsTheImpulseResponseAndItsWindow) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  const Ranging range = host.run(host.tag.range(0x6001));
  ASSERT_TRUE(range.good()) << range.failure;
  EXPECT_NEAR(range.info.distance_mm, 4080, 200);
  const auto whole = host.run(host.tag.read_cir(CirRead::whole));
  const auto window = host.run(host.tag.read_cir(CirRead::window));
  ASSERT_TRUE(whole && window);
  ASSERT_EQ(whole.value().taps.size(), 2032u);
  EXPECT_TRUE(std::equal(window.value().taps.begin(), window.value().taps.end(),
                         whole.value().taps.begin() + 2 * 672));
  EXPECT_TRUE(std::equal(window.value().noise.begin(), window.value().noise.end(),
                         whole.value().taps.begin() + 2 * 300));
}

TEST(PozyxTag, CountsADeviceThatIsNotThere) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  EXPECT_EQ(host.run(host.tag.range(0x7777)).failure, "no_answer");
  EXPECT_TRUE(host.run(host.tag.range(0x6001)).good());
}

TEST(PozyxTag, RefusesTheFailureValues) {
  Host stale(with_fault(sim::FaultKind::stale));
  ASSERT_TRUE(stale.run(stale.tag.identify()));
  EXPECT_TRUE(stale.run(stale.tag.range(0x6001)).good());
  stale.at(10);
  EXPECT_EQ(stale.run(stale.tag.range(0x6001)).fault, RangeFault::stale);
  EXPECT_EQ(stale.run(stale.tag.range(0x6002)).fault, RangeFault::too_far) << "167772160 mm";
  Host zero(with_fault(sim::FaultKind::zero));
  ASSERT_TRUE(zero.run(zero.tag.identify()));
  zero.at(10);
  EXPECT_EQ(zero.run(zero.tag.range(0x6001)).fault, RangeFault::zero_distance);
  Host none(with_fault(sim::FaultKind::no_event));
  ASSERT_TRUE(none.run(none.tag.identify()));
  none.at(10);
  EXPECT_EQ(none.run(none.tag.range(0x6001)).failure, "no_event");
  Host refuse(with_fault(sim::FaultKind::refuse));
  ASSERT_TRUE(refuse.run(refuse.tag.identify()));
  refuse.at(10);
  EXPECT_EQ(refuse.run(refuse.tag.range(0x6001)).failure, "refused");
  EXPECT_EQ(refuse.talk.counters().resyncs, 1u) << "at the beginning; a refusal is an answer";
}

TEST(PozyxTag, NeverTakesALateAnswerForAnother) {
  sim::Scenario scenario = with_fault(sim::FaultKind::late, 10, 12);
  scenario.tags[0].reply_s = 0.060;  // 60 + 150 ms: beyond our patience too
  Host host(scenario);
  ASSERT_TRUE(host.run(host.tag.identify()));
  host.at(9.9);
  int good = 0, bad = 0;
  for (int i = 0; i < 60; ++i) {
    const auto id = static_cast<std::uint16_t>(i % 2 ? 0x6001 : 0x6002);
    const Ranging range = host.run(host.tag.range(id));
    range.good() ? ++good : ++bad;
    if (range.good()) {
      EXPECT_NEAR(range.info.distance_mm, 4080, 200);
    }
  }
  EXPECT_GT(good, 30);
  EXPECT_GT(bad, 0);
  EXPECT_GT(host.talk.counters().timeouts, 0u);
}

TEST(PozyxTag, FindsItsWayThroughGarbage) {
  Host host(with_fault(sim::FaultKind::garbage, 5, 30));
  ASSERT_TRUE(host.run(host.tag.identify()));
  host.at(5);
  int good = 0, tries = 0;
  while (host.wire.at_s() < 30) {
    const Ranging range = host.run(host.tag.range(0x6001));
    ++tries;
    good += range.good();
    if (range.good()) {
      EXPECT_NEAR(range.info.distance_mm, 4080, 250);
    }
  }
  EXPECT_GT(good, 3) << "of " << tries;
  EXPECT_TRUE(host.run(host.talk.resync()));
  EXPECT_TRUE(host.run(host.tag.range(0x6001)).good());
}

TEST(PozyxTag, FindsTheDevicesAndRangesBetweenThem) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  std::vector<std::uint16_t> found;
  for (int i = 0; i < 10 && found.size() < 3; ++i)
    found = host.run(host.tag.discover(2, i == 0)).value();  // random slots miss some
  std::sort(found.begin(), found.end());
  EXPECT_EQ(found, (std::vector<std::uint16_t>{0x6001, 0x6002, 0x6003}));
  const Ranging between = host.run(host.tag.range_between(0x6001, 0x6003));
  ASSERT_TRUE(between.good()) << between.failure;
  EXPECT_NEAR(between.info.distance_mm, 8080, 200);
  EXPECT_EQ(host.run(host.tag.range_between(0x6001, 0x7777)).failure, "no_answer");
  EXPECT_EQ(host.run(host.tag.range_between(0x7777, 0x6001)).failure, "not_acknowledged");
}

TEST(PozyxTag, SetsItsRadioEverywhereAndVerifies) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  const UwbSettings wanted{2, 0, Prf::mhz64, 2048, 15.0};
  const auto applied = host.run(host.tag.set_uwb_everywhere(wanted, {0x6001, 0x6002, 0x6003}));
  ASSERT_TRUE(applied);
  EXPECT_TRUE(applied.value().all);
  EXPECT_TRUE(same_air(wanted, host.tag.settings()));
  EXPECT_TRUE(host.run(host.tag.range(0x6003)).good());
  EXPECT_FALSE(host.run(host.tag.set_uwb_everywhere({6, 0, Prf::mhz64, 2048, {}}, {})))
      << "there is no channel 6";
}

TEST(PozyxTag, RollsBackWhereOneDeviceDoesNotFollow) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  const UwbSettings before = host.tag.settings();
  const auto applied =
      host.run(host.tag.set_uwb_everywhere({2, 0, Prf::mhz64, 2048, {}}, {0x6001, 0x7777, 0x6003}), 120);
  ASSERT_TRUE(applied);
  EXPECT_FALSE(applied.value().all);
  EXPECT_TRUE(applied.value().rolled_back);
  EXPECT_NE(applied.value().devices[1].why, "");
  EXPECT_TRUE(same_air(before, host.tag.settings()));
  for (const std::uint16_t id : std::vector<std::uint16_t>{0x6001, 0x6002, 0x6003}) {
    EXPECT_TRUE(host.run(host.tag.range(id)).good()) << id;
  }
}

TEST(PozyxTag, TakesPositionsAndSoDoTheAnchors) {
  Host host;
  ASSERT_TRUE(host.run(host.tag.identify()));
  const std::vector<DeviceInfo> devices{{0x6001, true, {4.0004, -1.25, 2.5}}, {0x6002, true, {0, 4, 3.1}}};
  const auto applied = host.run(host.tag.push_positions(devices, true));
  ASSERT_TRUE(applied);
  EXPECT_TRUE(applied.value().all);
  const auto read = host.run(host.tag.remote_read(0x6001, 0x30, 12));
  ASSERT_TRUE(read) << read.error().message << applied.value().devices[0].why;
  ASSERT_TRUE(read);
  EXPECT_EQ(coordinates_m(read.value()), Eigen::Vector3d(4.000, -1.25, 2.5));
  const auto absent = host.run(host.tag.push_positions({{0x7777, true, {1, 2, 3}}}, false), 60);
  ASSERT_TRUE(absent);
  EXPECT_FALSE(absent.value().all);
  EXPECT_NE(absent.value().devices[0].why.find("not in the anchor"), std::string::npos);
}

TEST(PozyxTag, KnowsItsHeadingFromACalibratedCompassOnly) {
  sim::Scenario scenario = open_field();
  scenario.path[0].heading_rad = 1.0;
  Host host(scenario);
  ASSERT_TRUE(host.run(host.tag.identify()));
  EXPECT_EQ(host.run(host.tag.heading_deg()).value(), std::nullopt);
  ASSERT_TRUE(host.run(host.tag.set_sensors_mode(12)));
  host.wire.now_ns += 2'000'000'000;
  const auto heading = host.run(host.tag.heading_deg()).value();
  ASSERT_TRUE(heading);
  EXPECT_NEAR(*heading, 57.3, 0.1);
}

}  // namespace
}  // namespace anchord::pozyx::tag_test
