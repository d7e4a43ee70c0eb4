// The driver behind the server's own entrance and the simulated module at the other end of the wire, in one
// virtual time.
#include <gtest/gtest.h>

#include <random>

#include "drivers/device/settings.hpp"
#include "drivers/sim/dwm1001.hpp"
#include "tests/drivers/device/collect.hpp"

namespace anchord::dwm1001::tag_test {
namespace {

using device::test::Collect;
using record::EventKind;

constexpr std::int64_t k_ms = 1'000'000;

struct Wire {
  explicit Wire(const sim::Dwm1001::Options& module, const std::string& options = "{}")
      : module_(module), pipeline(sink) {
    take(EventKind::added,
         device::to_json(device::Settings{"d", "dwm1001", "", "serial:/dev/ttyACM0", options}));
  }
  void take(EventKind kind, std::string_view payload = {}) {
    const auto done =
        pipeline.take({kind, 1, {UtcTime{1'795'243'500'000'000'000 + now_ns}, now_ns}, payload});
    ASSERT_TRUE(done) << done.error().message;
  }
  /// Both ends for so long; nobody listens while `deaf`.
  void run(std::int64_t ms, bool deaf = false) {
    for (const auto end = now_ns + ms * k_ms; now_ns < end; now_ns += 10 * k_ms) {
      std::string in = deaf ? "" : module_.take(std::exchange(sink.sent[1], {}), now_ns);
      in += deaf ? "" : module_.tick(now_ns);
      // In cuts, as a USB port hands it on.
      for (std::size_t i = 0; i < in.size(); i += 7)
        take(EventKind::bytes, std::string_view(in).substr(i, 7));
      if (const auto due = pipeline.deadline_ns(1); due && *due <= now_ns) take(EventKind::tick);
    }
  }
  /// As a tag that moves away at 1 m/s.
  void fly(std::int64_t ms) {
    for (std::int64_t t = 0; t < ms; t += 100) {
      mm_ += 100;
      module_.measure(
          {{0x022e, mm_, 7940, 8030, 0, 100}, {0x9280, 2 * mm_, 7950, 0, 0, 90}, {0x5431, 0, 0, 0, 0, 0}});
      run(100);
    }
  }
  sim::Dwm1001 module_;
  Collect sink;
  device::Pipeline pipeline;
  std::int64_t now_ns{1'000 * k_ms};
  std::uint32_t mm_{3000};
};

TEST(Dwm1001, IsWokenAskedForItsIdAndItsDistancesAreRanges) {
  Wire wire({});
  wire.take(EventKind::opened);
  wire.run(4000);
  ASSERT_TRUE(wire.module_.streams());
  EXPECT_EQ(wire.sink.identities[1].model, "DWM1001");
  EXPECT_EQ(wire.sink.identities[1].network_id, NetworkId{0x6e01});
  wire.fly(5000);
  ASSERT_EQ(wire.sink.ranges.size(), 100u) << "two anchors, 10 Hz";
  for (std::size_t i = 0; i < 50; ++i) {
    const Range& near = wire.sink.ranges[2 * i];
    const Range& far = wire.sink.ranges[2 * i + 1];
    EXPECT_EQ(near.tag, NetworkId{0x6e01});
    EXPECT_EQ(near.anchor, NetworkId{0x022e});
    EXPECT_EQ(far.anchor, NetworkId{0x9280});
    EXPECT_NEAR(near.distance_m, 3.1 + 0.1 * static_cast<double>(i), 0.005) << "centimetres of the shell";
    EXPECT_NEAR(far.distance_m, 2 * near.distance_m, 0.02);
  }
  EXPECT_GT(wire.sink.ranges.back().time.ns, wire.sink.ranges.front().time.ns + 4'800 * k_ms);
  EXPECT_EQ(wire.sink.drops, (std::map<std::string, std::uint64_t>{{"zero_distance", 50}}));
}

TEST(Dwm1001, ThatWasLeftTalkingIsNotSwitchedOff) {
  sim::Dwm1001::Options left;
  left.in_shell = true;
  Wire wire(left);
  wire.module_.measure({{0x022e, 3380, 0, 0, 0, 100}});
  wire.take(EventKind::opened);
  wire.run(4000);
  EXPECT_TRUE(wire.module_.streams());
  const auto before = wire.sink.ranges.size();
  wire.run(2000);
  EXPECT_GT(wire.sink.ranges.size(), before + 15);
  for (const auto& range : wire.sink.ranges)
    EXPECT_EQ(range.tag, NetworkId{0x6e01}) << "none before its id is known";
  wire.take(EventKind::closed);
  wire.take(EventKind::opened);
  wire.run(4000);
  EXPECT_TRUE(wire.module_.streams()) << "the same after the cable was pulled";
}

TEST(Dwm1001, SaysWhyNothingCanBeHadOfIt) {
  Wire dead({});
  dead.take(EventKind::opened);
  dead.run(10'000, true);
  EXPECT_EQ(dead.sink.hung_up, "no DWM1001 shell answers: is this the right port, at 115200 baud?");
  sim::Dwm1001::Options mute;
  mute.says_id = false;
  Wire unnamed(mute);
  unnamed.take(EventKind::opened);
  unnamed.run(8000);
  EXPECT_EQ(unnamed.sink.hung_up, "its shell does not show the id (command si): set the option tag");
  Wire named(mute, R"({"tag":"0x0077"})");
  named.take(EventKind::opened);
  named.run(8000);
  named.fly(1000);
  ASSERT_FALSE(named.sink.ranges.empty());
  EXPECT_EQ(named.sink.ranges[0].tag, NetworkId{0x77});
  named.take(EventKind::command, device::to_json(device::Command{3, "reboot", ""}));
  EXPECT_EQ(named.sink.answers.at(3), "error: a DWM1001 does not support commands");
}

TEST(Dwm1001, IsPolledInBinaryAndARepeatedAnswerIsNoMeasurement) {
  Wire wire({}, R"({"mode":"tlv","tag":"0x6e01"})");
  wire.take(EventKind::opened);
  wire.fly(5000);
  ASSERT_GT(wire.sink.ranges.size(), 80u);
  EXPECT_DOUBLE_EQ(wire.sink.ranges[1].distance_m, 2 * wire.sink.ranges[0].distance_m) << "millimetres";
  const auto rows = wire.sink.ranges.size();
  wire.run(1000);
  EXPECT_LE(wire.sink.ranges.size(), rows + 2);
  EXPECT_GE(wire.sink.drops["repeated"], 7u);
  wire.run(2000, true);
  EXPECT_GE(wire.sink.drops["no_reply"], 3u);
  wire.fly(1000);
  EXPECT_GT(wire.sink.ranges.size(), rows + 10) << "it comes back by itself";
  sim::Dwm1001::Options fixed;
  fixed.is_anchor = true;
  Wire anchor(fixed, R"({"mode":"tlv","tag":"0x6e01"})");
  anchor.take(EventKind::opened);
  anchor.run(500);
  EXPECT_EQ(anchor.sink.hung_up, "this DWM1001 is set up as an anchor: make it a tag");
}

TEST(Dwm1001, BearsAnyBytesAndGoesOn) {
  for (const char* mode : {R"({"tag":"0x6e01"})", R"({"mode":"tlv","tag":"0x6e01"})"}) {
    Wire wire({}, mode);
    wire.take(EventKind::opened);
    wire.run(4000);
    std::mt19937_64 random(5);
    for (int i = 0; i < 500; ++i) {
      std::string noise(random() % 4000, '\0');
      for (char& c : noise) c = static_cast<char>(random());
      wire.take(EventKind::bytes, noise);
    }
    wire.take(EventKind::bytes, std::string(100'000, 'x') + "\r\n");
    const auto rows = wire.sink.ranges.size();
    wire.run(1000);
    wire.fly(2000);
    EXPECT_GT(wire.sink.ranges.size(), rows + 20) << mode;
  }
}

TEST(Dwm1001, NamesTheOptionThatIsWrong) {
  Collect sink;
  device::Pipeline pipeline(sink);
  const auto why = [&](const std::string& options) {
    const auto done = pipeline.take(
        {EventKind::added,
         1,
         {},
         device::to_json(device::Settings{"t", "dwm1001", "", "serial:/dev/ttyACM0", options})});
    return done ? "" : done.error().message;
  };
  EXPECT_EQ(why("{}"), "");
  EXPECT_EQ(why(R"({"mode":"spi"})"), "mode: must be one of shell, tlv");
  EXPECT_EQ(why(R"({"mode":"tlv"})"), "tag: is needed in binary mode: give an id like 0x022e");
  EXPECT_EQ(why(R"({"tag":7})"), "tag: must be an id like 0x022e");
  EXPECT_EQ(why(R"({"baud":7})"), "baud: no such option: a dwm1001 device has mode, tag");
}

}  // namespace
}  // namespace anchord::dwm1001::tag_test
