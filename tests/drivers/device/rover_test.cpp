#include "drivers/gnss/rover.hpp"

#include <gtest/gtest.h>

#include "../gnss/samples.hpp"
#include "collect.hpp"
#include "drivers/device/settings.hpp"

namespace anchord::gnss::rover_test {
namespace {

using device::test::Collect;
using record::EventKind;

constexpr std::int64_t k_ms = 1'000'000, k_s = 1'000'000'000;
constexpr std::int64_t k_epoch = 1'718'532'000 * k_s;  // 2024-06-16T10:00:00Z

struct OneRover {
  explicit OneRover(const std::string& options = "{}") : pipeline(sink) {
    take(EventKind::added, 0, device::to_json({"r", "gnss", "", "tcp://127.0.0.1:1", options}));
    take(EventKind::opened, 0);
  }
  void take(EventKind kind, std::int64_t steady, std::string_view payload = {}) {
    const auto done = pipeline.take({kind, 1, {UtcTime{k_epoch + steady}, steady}, payload});
    EXPECT_TRUE(done) << done.error().message;
  }
  void settle() {
    if (const auto due = pipeline.deadline_ns(1)) take(EventKind::tick, *due);
  }
  Collect sink;
  device::Pipeline pipeline;
};

std::string gga(int second, int quality = 4) {
  char text[160];
  std::snprintf(text, sizeof text,
                "GNGGA,1000%02d.00,5101.3687380,N,00342.6274020,E,%d,14,0.9,22.500,M,45.012,M,0.8,0000",
                second, quality);
  return test::sentence(text);
}
std::string rmc(int second) {
  char text[160];
  std::snprintf(text, sizeof text, "GNRMC,1000%02d.00,A,5101.3687380,N,00342.6274020,E,0.1,0.0,160624,,,R",
                second);
  return test::sentence(text);
}

TEST(Rover, GivesAnEpochWhenTheWireFallsQuietAndNotASecondLater) {
  OneRover rover;
  rover.take(EventKind::bytes, 80 * k_ms, rmc(0) + gga(0));
  EXPECT_TRUE(rover.sink.fixes.empty());
  ASSERT_TRUE(rover.pipeline.deadline_ns(1));
  EXPECT_EQ(*rover.pipeline.deadline_ns(1), 130 * k_ms);
  rover.settle();
  ASSERT_EQ(rover.sink.fixes.size(), 1U);
  const auto& fix = rover.sink.fixes[0];
  EXPECT_EQ(fix.time.ns, k_epoch);
  EXPECT_EQ(fix.received->ns, k_epoch + 80 * k_ms) << "when its first byte came";
  EXPECT_EQ(fix.fix, FixClass::rtk_fixed);
  EXPECT_NEAR(fix.position.height_m, 67.512, 1e-9);  // 22.5 + 45.012
  EXPECT_FALSE(rover.pipeline.deadline_ns(1));
}

TEST(Rover, MakesNoFixOutOfNoFixButShowsIt) {
  OneRover rover;
  rover.take(EventKind::bytes, 80 * k_ms, rmc(0) + gga(0, 0));
  rover.settle();
  EXPECT_TRUE(rover.sink.fixes.empty());
  ASSERT_EQ(rover.sink.rovers.size(), 1U);
  EXPECT_EQ(rover.sink.rovers[0].fix, FixClass::none);
  EXPECT_EQ(rover.sink.drops["no_fix"], 1U);
}

TEST(Rover, ABrokenSumIsCountedAndTheHalfFrameOfAPulledPlugIsGone) {
  OneRover rover;
  auto broken = gga(1);
  broken[20] = broken[20] == '5' ? '6' : '5';
  rover.take(EventKind::bytes, 0, rmc(0) + gga(0) + broken);
  rover.settle();
  EXPECT_EQ(rover.sink.fixes.size(), 1U);
  std::uint64_t counted = 0;
  for (const auto& [reason, n] : rover.sink.drops) counted += n;
  EXPECT_GE(counted, 1U);
  const auto next = gga(2);
  rover.take(EventKind::bytes, 2 * k_s, next.substr(0, 40));
  rover.take(EventKind::closed, 2 * k_s + k_ms);
  rover.take(EventKind::opened, 5 * k_s);
  rover.take(EventKind::bytes, 5 * k_s + k_ms, next.substr(40) + rmc(5) + gga(5));
  rover.settle();
  ASSERT_EQ(rover.sink.fixes.size(), 2U) << "no measurement is made from two halves";
  EXPECT_EQ(rover.sink.fixes[1].time.ns, k_epoch + 5 * k_s);
}

TEST(Rover, OfTwoFormatsOnOneWireTakesTheOneThatSaysMore) {
  OneRover rover;
  rover.take(EventKind::bytes, 0, rmc(0) + gga(0));
  rover.settle();
  ASSERT_EQ(rover.sink.fixes.size(), 1U);
  for (int i = 1; i < 4; ++i) {
    rover.take(EventKind::bytes, i * k_s, test::k_pvt + test::k_hp + rmc(i) + gga(i));
    rover.settle();
  }
  EXPECT_GE(rover.sink.drops["other_format"], 3U);
  EXPECT_EQ(rover.sink.identities[1].model, "GNSS receiver (ubx)");
}

TEST(Rover, AsksAGpsdForReportsWhenItGreets) {
  OneRover rover;
  EXPECT_TRUE(rover.sink.sent[1].empty());
  rover.take(EventKind::bytes, 0, R"({"class":"VERSION","release":"3.22","rev":"3.22","proto_)");
  rover.take(EventKind::bytes, k_ms, "major\":3,\"proto_minor\":14}\r\n");
  EXPECT_EQ(rover.sink.sent[1], "?WATCH={\"enable\":true,\"json\":true};\n");
  rover.take(EventKind::bytes, 2 * k_ms,
             R"({"class":"TPV","status":3,"mode":3,"time":"2024-06-16T10:00:00.000Z","lat":51.022827740,)"
             R"("lon":3.710564222,"altHAE":63.5760})"
             "\r\n"
             R"({"class":"GST","time":"2024-06-16T10:00:00.000Z","lat":0.009,"lon":0.014,"alt":0.021})"
             "\r\n");
  ASSERT_EQ(rover.sink.fixes.size(), 1U);
  EXPECT_EQ(rover.sink.fixes[0].fix, FixClass::rtk_fixed);
  EXPECT_NEAR((*rover.sink.fixes[0].covariance_m2)(0, 0), 0.014 * 0.014, 1e-12);
}

TEST(Rover, NmeaWithoutADateTakesTheHostsAfterFiveSeconds) {
  OneRover rover;
  for (int i = 0; i < 9; ++i) {
    rover.take(EventKind::bytes, i * k_s + 80 * k_ms, gga(i));
    rover.settle();
  }
  ASSERT_FALSE(rover.sink.fixes.empty());
  EXPECT_EQ(rover.sink.fixes.back().time.ns, k_epoch + 8 * k_s);
}

TEST(Rover, TeachesTheTimeBaseUtc) {
  OneRover rover(R"({"latency_ms":80})");
  for (int i = 0; i < 20; ++i) {
    rover.take(EventKind::bytes, i * k_s + 80 * k_ms, rmc(i) + gga(i));
    rover.settle();
  }
  EXPECT_EQ(rover.pipeline.time().source(), timing::TimeSource::receiver);
  EXPECT_NEAR(static_cast<double>(rover.pipeline.time().utc_of(25 * k_s).time.ns - (k_epoch + 25 * k_s)), 0,
              1e5);
}

// A MediaTek receiver before its first fix has counted from 1980: that became the time of all the server had.
TEST(Rover, WithoutAFixItSaysNoTimeWhateverItsClockShows) {
  for (const char* date : {"060180", "160624"}) {
    OneRover rover;
    for (int i = 0; i < 30; ++i) {
      char text[160];
      std::snprintf(text, sizeof text, "GPRMC,0000%02d.00,V,,,,,0.00,0.00,%s,,,N", i + 2, date);
      const auto cold = test::sentence(text);
      std::snprintf(text, sizeof text, "GPGGA,0000%02d.00,,,,,0,00,,,M,,M,,", i + 2);
      rover.take(EventKind::bytes, i * k_s + 80 * k_ms, test::sentence(text) + cold);
      rover.settle();
    }
    EXPECT_EQ(rover.pipeline.time().source(), timing::TimeSource::system_clock);
    EXPECT_EQ(rover.sink.drops["no_fix"], 30U);
    // Its first fix, a second before the date is right.
    rover.take(EventKind::bytes, 40 * k_s, gga(40));
    rover.settle();
    rover.take(EventKind::bytes, 41 * k_s, gga(41) + rmc(41));
    rover.settle();
    ASSERT_EQ(rover.sink.fixes.size(), 2U);
    EXPECT_EQ(rover.sink.fixes[0].time.ns, k_epoch + 40 * k_s);
    EXPECT_EQ(rover.sink.fixes[1].time.ns, k_epoch + 41 * k_s);
  }
}

TEST(Rover, WithAWeekRolloverItsPositionsAreNotUsedAndItSaysWhy) {
  OneRover rover;
  for (int i = 0; i < 20; ++i) {
    auto text = rmc(i);
    text.replace(text.find("160624"), 6, "311004");  // 1024 weeks before
    text = test::sentence(std::string(text.substr(1, text.find('*') - 1)));
    rover.take(EventKind::bytes, i * k_s + 80 * k_ms, text + gga(i));
    rover.settle();
  }
  EXPECT_TRUE(rover.sink.fixes.empty());
  EXPECT_EQ(rover.sink.drops["date_not_believed"], 20U);
  EXPECT_EQ(rover.pipeline.time().source(), timing::TimeSource::system_clock);
  EXPECT_NE(rover.sink.notices[1].find("2004-10-31, 1024 weeks early (GPS week rollover)"), std::string::npos)
      << rover.sink.notices[1];
  rover.take(EventKind::bytes, 30 * k_s, rmc(30) + gga(30));
  rover.settle();
  EXPECT_EQ(rover.sink.fixes.size(), 1U);
  EXPECT_EQ(rover.sink.notices[1], "");
}

TEST(Rover, AnEpochAnHourOffIsNoFixUnlessTheNextOneSaysTheSameAndTakesNoOtherWithIt) {
  OneRover rover;
  const auto at = [](int hour, int second) {
    char text[160];
    std::snprintf(text, sizeof text,
                  "GNGGA,%02d00%02d.00,5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000",
                  hour, second);
    return test::sentence(text);
  };
  const auto second = [&](int s, const std::string& bytes) {
    rover.take(EventKind::bytes, s * k_s + 80 * k_ms, bytes);
    rover.settle();
  };
  second(0, rmc(0) + at(10, 0));
  second(1, at(10, 1) + at(11, 1));
  second(2, at(10, 2) + at(9, 2));
  second(3, at(10, 3));
  for (int s = 4; s < 8; ++s) second(s, at(11, s));
  std::vector<std::int64_t> times_s;
  for (const auto& fix : rover.sink.fixes) times_s.push_back((fix.time.ns - k_epoch) / k_s);
  EXPECT_EQ(times_s, (std::vector<std::int64_t>{0, 1, 2, 3, 3605, 3606, 3607}));
  EXPECT_EQ(rover.sink.drops["time_step"], 3U);
}

TEST(Rover, EpochsThatWaitedOnTheWayAreAllTaken) {
  OneRover rover;
  rover.take(EventKind::bytes, 80 * k_ms, rmc(0) + gga(0));
  rover.settle();
  for (int s = 1; s <= 30; ++s) rover.take(EventKind::bytes, 30 * k_s + s * k_ms, gga(s));
  rover.settle();
  rover.take(EventKind::bytes, 31 * k_s + 80 * k_ms, gga(31));
  rover.settle();
  EXPECT_EQ(rover.sink.fixes.size(), 32U);
  EXPECT_EQ(rover.sink.drops["time_step"], 0U);
}

/// Two receivers of one server, 1.5 m apart, that measure at the same moments.
struct TwoRovers {
  TwoRovers() : pipeline(sink) {
    for (const std::uint16_t slot : {std::uint16_t{1}, std::uint16_t{2}}) {
      take(EventKind::added, slot, 0,
           device::to_json({"r" + std::to_string(slot), "gnss", "", "tcp://127.0.0.1:1", "{}"}));
      take(EventKind::opened, slot, 0);
    }
  }
  void take(EventKind kind, std::uint16_t slot, std::int64_t steady, std::string_view payload = {}) {
    const auto done = pipeline.take({kind, slot, {UtcTime{k_epoch + steady}, steady}, payload});
    EXPECT_TRUE(done) << done.error().message;
  }
  /// Both in the second; the fixes that come of it.
  std::vector<FixClass> second(int s, std::optional<int> first, std::optional<int> other) {
    sink.fixes.clear();
    for (const auto& [slot, quality] : {std::pair<std::uint16_t, std::optional<int>>{1, first}, {2, other}}) {
      if (!quality) continue;
      take(EventKind::bytes, slot, s * k_s + 80 * k_ms, rmc(s) + gga(s, *quality));
      if (const auto due = pipeline.deadline_ns(slot)) take(EventKind::tick, slot, *due);
    }
    std::vector<FixClass> out;
    for (const auto& fix : sink.fixes) out.push_back(fix.fix);
    return out;
  }
  Collect sink;
  device::Pipeline pipeline;
};
constexpr int k_fixed = 4, k_float = 5, k_single = 1;
const char* const k_some_mission = "01a2296a-da79-7389-9034-b3afdf9ede3d";

TEST(TwoReceivers, OneGivesTheTrackAndTheOtherIsNamed) {
  using C = FixClass;
  TwoRovers two;
  EXPECT_EQ(two.second(0, k_float, k_fixed).size(), 2U) << "nothing is stored: both are seen";
  EXPECT_NE(two.sink.unused_why[2].find("another receiver gives the track"), std::string::npos)
      << "before the flight";
  two.take(EventKind::mission, 0, k_s, k_some_mission);
  EXPECT_EQ(two.second(1, k_float, k_fixed), std::vector{C::rtk_float});
  EXPECT_NE(two.sink.unused_why[2].find("another receiver gives the track"), std::string::npos);
  EXPECT_EQ(two.sink.drops["other_source"], 1U);
  EXPECT_EQ(two.sink.unused_why[1], "");
  EXPECT_EQ(two.second(2, k_float, k_fixed), std::vector{C::rtk_float});
  for (int s = 3; s < 12; ++s)
    EXPECT_TRUE(two.second(s, std::nullopt, k_fixed).empty()) << "a place 1.5 m away, " << s;
  EXPECT_EQ(two.second(12, k_fixed, k_fixed), std::vector{C::rtk_fixed});
  two.take(EventKind::closed, 2, 12 * k_s + 500 * k_ms);
  EXPECT_EQ(two.sink.unused_why[2], "") << "it gives nothing";
  two.take(EventKind::removed, 1, 13 * k_s);
  EXPECT_EQ(two.second(14, std::nullopt, k_fixed), std::vector{C::rtk_fixed});
  EXPECT_EQ(two.sink.unused_why[2], "");
}

TEST(TwoReceivers, OneWithoutRtkGivesWayToOneThatHasIt) {
  using C = FixClass;
  TwoRovers two;
  two.take(EventKind::mission, 0, 0, k_some_mission);
  EXPECT_EQ(two.second(0, k_single, k_single), std::vector{C::single});
  EXPECT_EQ(two.second(1, k_single, k_fixed), (std::vector{C::single, C::rtk_fixed}));
  EXPECT_EQ(two.second(2, k_single, k_float), std::vector{C::rtk_float});
  EXPECT_EQ(two.sink.unused_why[2], "");
  EXPECT_NE(two.sink.unused_why[1], "");
}

TEST(TwoReceivers, OneThatWasSilentBeforeTheFlightIsNotWaitedFor) {
  TwoRovers two;
  EXPECT_EQ(two.second(0, k_fixed, std::nullopt).size(), 1U);
  two.take(EventKind::mission, 0, 20 * k_s, k_some_mission);
  EXPECT_EQ(two.second(21, std::nullopt, k_fixed).size(), 1U);
  EXPECT_TRUE(two.second(22, k_fixed, std::nullopt).empty());
}

TEST(Rover, RefusesOptionsItDoesNotKnow) {
  Collect sink;
  device::Pipeline pipeline(sink);
  const auto add = [&](const std::string& options) {
    return pipeline.take({EventKind::added, 1, {}, device::to_json({"r", "gnss", "", "", options})});
  };
  EXPECT_TRUE(add(R"({"format":"ubx","latency_ms":20})"));
  EXPECT_FALSE(add(R"({"format":"sirf"})"));
  EXPECT_FALSE(add(R"({"latency_ms":-1})"));
  const auto unknown = add(R"({"speed":9600})");
  ASSERT_FALSE(unknown);
  EXPECT_NE(unknown.error().message.find("speed"), std::string::npos);
}

}  // namespace
}  // namespace anchord::gnss::rover_test
