// Home-made tags: lines of JSON by a mapping, behind the server's own entrance, and what nobody should send.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "drivers/device/settings.hpp"
#include "tests/drivers/device/collect.hpp"

namespace anchord::mapping::ndjson_test {
namespace {

using device::test::Collect;
using Json = nlohmann::json;
using record::EventKind;

constexpr std::int64_t k_start_ns = 1'795'243'500'000'000'000;  // 2026-11-21

struct Line {
  explicit Line(const std::string& mapping, const std::string& address = "tcp-listen://:0") : pipeline(sink) {
    take(EventKind::added,
         device::to_json(device::Settings{"t", "ndjson", "", address, R"({"mapping":)" + mapping + '}'}));
    take(EventKind::opened);
  }
  void take(EventKind kind, std::string_view payload = {}) {
    const auto done = pipeline.take({kind, 1, {UtcTime{k_start_ns + now_ns}, now_ns}, payload});
    EXPECT_TRUE(done) << done.error().message;
  }
  void say(std::string_view text) { take(EventKind::bytes, text); }
  Collect sink;
  device::Pipeline pipeline;
  std::int64_t now_ns{1'000'000'000};
};

const std::string k_plain = R"({"tag":"/tag","anchor":"/anchor","distance":{"pointer":"/d","unit":"mm"}})";

TEST(Ndjson, IsOneRangeALineAtItsArrivalWhereItHasNoTime) {
  Line line(k_plain);
  line.say("{\"tag\":27183,\"anchor\":\"0x6a3c\",\"d\":7412}\n");
  ASSERT_EQ(line.sink.ranges.size(), 1u);
  const Range& range = line.sink.ranges[0];
  EXPECT_EQ(range.tag, NetworkId{27183});
  EXPECT_EQ(range.anchor, NetworkId{0x6a3c});
  EXPECT_DOUBLE_EQ(range.distance_m, 7.412);
  EXPECT_EQ(range.time.ns, k_start_ns + line.now_ns);
  EXPECT_FALSE(range.rss_dbm);
  EXPECT_GT(line.sink.heard_count, 0);
  EXPECT_TRUE(line.sink.drops.empty());
}

TEST(Ndjson, ReadsEveryValueWhereAndInWhatUnitTheMappingSays) {
  Line line(
      R"({"array":"/meas","tag":"#/head/id","anchor":"/0","distance":{"pointer":"/1/r","unit":"ft","scale":0.5},
    "id_format":"hex","rss":{"pointer":"/2","unit":"cdBm"},"first_path":{"pointer":"/fp~1x"},"seq":"#/n",
    "time":{"pointer":"#/ts","unit":"us"}})");
  const auto t_us = (k_start_ns + line.now_ns) / 1000 - 40'000;
  line.say("x\n" +
           Json{{"head", {{"id", "10"}}},
                {"n", 77},
                {"ts", t_us},
                {"meas", {{"6A3C", {{"r", "40"}}, -8430}, {"6A3D", {{"r", 50.0}}, -9000}}}}
               .dump() +
           '\n');
  ASSERT_EQ(line.sink.ranges.size(), 2u);
  const Range& range = line.sink.ranges[0];
  EXPECT_EQ(range.tag, NetworkId{0x10});
  EXPECT_EQ(range.anchor, NetworkId{0x6a3c});
  EXPECT_DOUBLE_EQ(range.distance_m, 40 * 0.5 * 0.3048);
  EXPECT_DOUBLE_EQ(range.rss_dbm.value_or(0), -84.3);
  EXPECT_FALSE(range.fp_dbm) << "the key is not there";
  EXPECT_EQ(range.seq, 77u);
  EXPECT_EQ(range.time.us(), t_us);
  EXPECT_EQ(line.sink.ranges[1].anchor, NetworkId{0x6a3d});
  EXPECT_TRUE(line.sink.drops.empty())
      << "the rest of a line that began before we listened is nobody's fault";
}

TEST(Ndjson, ReadsTimesOfEveryUnitAndRefusesThoseOfAClockThatIsNotSet) {
  const auto at = [](const std::string& time, const std::string& value) {
    Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},"time":{"pointer":"/ts",)" +
              time + "}}");
    line.say(R"({"t":1,"a":2,"d":3,"ts":)" + value + "}\n");
    if (line.sink.ranges.empty()) {
      EXPECT_EQ(line.sink.drops.size(), 1u);
      return line.sink.drops.begin()->first;
    }
    return std::to_string(line.sink.ranges[0].time.us());
  };
  // One second after the start, which is 2026-11-21T06:45:00Z.
  EXPECT_EQ(at(R"("unit":"s")", "1795243501"), "1795243501000000");
  EXPECT_EQ(at(R"("unit":"s")", "1795243500.25"), "1795243500250000");
  EXPECT_EQ(at(R"("unit":"s")", "\"1795243500.25\""), "1795243500250000");
  EXPECT_EQ(at(R"("unit":"ms")", "1795243501001"), "1795243501001000");
  EXPECT_EQ(at(R"("unit":"ns")", "1795243501000007000"), "1795243501000007");
  EXPECT_EQ(at(R"("unit":"rfc3339")", "\"2026-11-21T06:45:01.5Z\""), "1795243501500000");
  for (const char* value : {"0", "12.5", "1795243400", "1795243600"})
    EXPECT_EQ(at(R"("unit":"s")", value), "time_off") << value;
  for (const char* value :
       {"-1", "1e300", "true", "null", "[]", "\"noon\"", "\"nan\"", "18446744073709551615"})
    EXPECT_EQ(at(R"("unit":"s")", value), "bad_time") << value;
  EXPECT_EQ(at(R"("unit":"rfc3339")", "\"yesterday\""), "bad_time");
  EXPECT_EQ(at(R"("unit":"rfc3339")", "7"), "bad_time");
}

TEST(Ndjson, FollowsTheOwnClockOfADeviceOverItsWrap) {
  // Milliseconds of 16 bits: wraps each 65.5 s. Links delay 2 to 30 ms.
  Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},
    "time":{"pointer":"/ms","unit":"ms","clock":"device","wrap_bits":16}})");
  std::int64_t worst_ns = 0;
  for (std::int64_t i = 0; i < 2000; ++i) {
    const std::int64_t measured_ns = 5'000'000'000 + i * 100'000'000;
    line.now_ns = measured_ns + 2'000'000 + (i * 7919 % 29) * 1'000'000;
    line.say(R"({"t":1,"a":2,"d":3,"ms":)" + std::to_string((60'000 + i * 100) % 65'536) + "}\n");
    const auto got = line.sink.ranges.back().time.ns - k_start_ns;
    // What is never seen cannot be told from the offset: the least delay.
    if (i > 300) worst_ns = std::max(worst_ns, std::abs(got - measured_ns - 2'000'000));
  }
  EXPECT_EQ(line.sink.ranges.size(), 2000u);
  EXPECT_LT(worst_ns, 2'000'000) << "the delays are gone";
  line.say(R"({"t":1,"a":2,"d":3,"ms":65536})"
           "\n");
  line.say(R"({"t":1,"a":2,"d":3,"ms":-1})"
           "\n");
  EXPECT_EQ(line.sink.drops["bad_time"], 2u);
}

TEST(Ndjson, StampsByTheArrivalWhereTheOwnClockOfADeviceStandsStillOrHasAnotherUnitAndSaysSo) {
  // Ten ranges a second; the mapping takes the counter for milliseconds.
  for (const std::int64_t per_range : {0, 100'000'000}) {  // frozen; in truth nanoseconds
    Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},
      "time":{"pointer":"/ms","unit":"ms","clock":"device"}})");
    const auto say = [&](std::int64_t count) {
      line.now_ns += 100'000'000;
      line.say(R"({"t":1,"a":2,"d":3,"ms":)" + std::to_string(count) + "}\n");
      return line.sink.ranges.back().time.ns - k_start_ns - line.now_ns;
    };
    std::int64_t worst_ns = 0;
    for (std::int64_t i = 0; i < 100; ++i) {
      const auto off_ns = say(1000 + i * per_range);
      if (i >= 20) worst_ns = std::max(worst_ns, std::abs(off_ns));
    }
    EXPECT_EQ(worst_ns, 0) << per_range;
    EXPECT_NE(line.sink.notices[1].find("0x0001 does not run at our rate"), std::string::npos)
        << line.sink.notices[1];
    // It is corrected: nothing is left of it.
    for (std::int64_t i = 0; i < 100; ++i) say(i * 100);
    EXPECT_EQ(line.sink.notices[1], "") << per_range;
  }
}

TEST(Ndjson, NamesATagWhoseClockStandsStillUntilNoneDoes) {
  Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},
    "time":{"pointer":"/ms","unit":"ms","clock":"device"}})");
  const auto say = [&](int tag, std::int64_t count) {
    line.say(R"({"t":)" + std::to_string(tag) + R"(,"a":9,"d":3,"ms":)" + std::to_string(count) + "}\n");
  };
  std::int64_t i = 0;
  const auto pass = [&](bool first_runs) {
    for (const auto end = i + 50; i < end; ++i) {
      line.now_ns += 100'000'000;
      say(1, first_runs ? i * 100 : 7);
      say(2, 7);
    }
  };
  pass(false);
  EXPECT_NE(line.sink.notices[1], "");
  pass(true);
  EXPECT_NE(line.sink.notices[1], "") << "0x0002 still stands still";
}

TEST(Ndjson, KeepsTheOwnClockOfADeviceOverALinkThatHoldsEverythingBackForFiveSeconds) {
  Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},
    "time":{"pointer":"/ms","unit":"ms","clock":"device"}})");
  for (std::int64_t i = 0; i < 400; ++i) {
    const std::int64_t measured_ns = 5'000'000'000 + i * 100'000'000;
    line.now_ns = i >= 200 && i < 250 ? 5'000'000'000 + 25'000'000'000 : measured_ns;
    line.say(R"({"t":1,"a":2,"d":3,"ms":)" + std::to_string(i * 100) + "}\n");
    EXPECT_EQ(line.sink.notices[1], "") << i;
  }
}

TEST(Ndjson, TakesALevelThatIsNullForUnknownAndANumberInTextForASequence) {
  Line line(R"({"tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},"rss":"/p","seq":"/n"})");
  line.say(R"({"t":1,"a":2,"d":3,"p":null,"n":"4711"})"
           "\n");
  ASSERT_EQ(line.sink.ranges.size(), 1u);
  EXPECT_FALSE(line.sink.ranges[0].rss_dbm);
  EXPECT_EQ(line.sink.ranges[0].seq, 4711u);
}

/// Reasons by what was said, each line by itself.
std::map<std::string, std::uint64_t> drops_of(const std::string& mapping, const std::string& text) {
  Line line(mapping);
  line.say("{}\n");
  line.sink.drops.clear();
  line.say(text + '\n');
  EXPECT_TRUE(line.sink.ranges.empty()) << text.substr(0, 100);
  return line.sink.drops;
}

TEST(Ndjson, CountsWhatCannotBeUsedByItsReason) {
  using Drops = std::map<std::string, std::uint64_t>;
  const auto of = [](const std::string& text) { return drops_of(k_plain, text); };
  EXPECT_EQ(of("not json"), (Drops{{"not_json", 1}}));
  EXPECT_EQ(of(R"({"tag":1,"anchor":2,"d":3000)"), (Drops{{"not_json", 1}})) << "cut";
  EXPECT_EQ(of(R"({"tag":1,"anchor":2,"d":1e400})"), (Drops{{"not_json", 1}}));
  EXPECT_EQ(of(R"({"tag":1,"anchor":2,"d":NaN})"), (Drops{{"not_json", 1}}));
  EXPECT_EQ(of("{\"tag\":\"\xff\"}"), (Drops{{"not_utf8", 1}}));
  EXPECT_EQ(of("null"), (Drops{{"bad_tag", 1}}));
  EXPECT_EQ(of("[1,2]"), (Drops{{"bad_tag", 1}}));
  EXPECT_EQ(of(R"({"tag":-1,"anchor":2,"d":3000})"), (Drops{{"bad_tag", 1}}));
  EXPECT_EQ(of(R"({"tag":1.5,"anchor":2,"d":3000})"), (Drops{{"bad_tag", 1}}));
  EXPECT_EQ(of(R"({"tag":{"id":1},"anchor":2,"d":3000})"), (Drops{{"bad_tag", 1}}));
  EXPECT_EQ(of(R"({"tag":1,"anchor":1,"d":3000})"), (Drops{{"bad_anchor", 1}}));
  EXPECT_EQ(of(R"({"tag":1,"d":3000})"), (Drops{{"bad_anchor", 1}}));
  for (const char* d : {"null", "true", "[]", "\"\"", "\"12 mm\"", "\"inf\"", "\"0x10\""})
    EXPECT_EQ(of(R"({"tag":1,"anchor":2,"d":)" + std::string(d) + '}'), (Drops{{"bad_distance", 1}})) << d;
  for (const char* d : {"0", "-3000", "49", "150001", "1e300"})
    EXPECT_EQ(of(R"({"tag":1,"anchor":2,"d":)" + std::string(d) + '}'), (Drops{{"out_of_reach", 1}})) << d;
  const std::string list =
      R"({"array":"/r","tag":"#/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"},"rss":"/p"})";
  EXPECT_EQ(drops_of(list, R"({"t":1,"r":{"a":2,"d":3}})"), (Drops{{"no_array", 1}}));
  EXPECT_EQ(drops_of(list, R"({"t":1,"r":[{"a":2,"d":3,"p":"loud"},{"a":2,"d":3,"p":51},7]})"),
            (Drops{{"bad_power", 2}, {"bad_anchor", 1}}));
  std::string many = R"({"t":1,"r":[0)";
  for (int i = 0; i < 10'000; ++i) many += ",0";
  EXPECT_EQ(drops_of(list, many + "]}"), (Drops{{"too_many", 10'001}}));
}

TEST(Ndjson, BearsBombsAndGoesOnWithTheNextLine) {
  const std::string good = R"({"tag":1,"anchor":2,"d":3000})"
                           "\n";
  Line line(k_plain);
  line.say(good);
  line.say(std::string(100'000, '[') + '\n');
  EXPECT_EQ(line.sink.drops["too_deep"], 1u);
  line.say(good);
  std::string deep;
  for (int i = 0; i < 20'000; ++i) deep += "{\"a\":";
  line.say(deep + '\n');
  EXPECT_EQ(line.sink.drops["too_deep"], 2u);
  line.say(R"({"tag":1,"anchor":2,"d":3000,"note":"[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[\"[[["})"
           "\n");
  EXPECT_EQ(line.sink.drops["too_deep"], 2u) << "brackets of a text are no depth";
  for (int i = 0; i < 640; ++i) line.say(std::string(16 * 1024, 'x'));  // 10 MB without an end
  line.say("\n" + good);
  EXPECT_EQ(line.sink.drops["too_large"], 1u);
  line.say(std::string(300, '\0') + "\n\r\n  \n" + good);
  EXPECT_EQ(line.sink.ranges.size(), 5u);
}

TEST(Ndjson, ReadsTheSameInAnyCutAndADatagramWithoutLineEnd) {
  const std::string text = R"({"tag":1,"anchor":2,"d":3000})"
                           "\r\n"
                           R"({"tag":1,"anchor":3,"d":4000})"
                           "\n";
  Line whole(k_plain), cut(k_plain), datagram(k_plain, "udp://:0");
  whole.say(text);
  for (const char c : text) cut.say(std::string_view(&c, 1));
  EXPECT_EQ(whole.sink.rows, cut.sink.rows);
  datagram.say(R"({"tag":1,"anchor":2,"d":3000})");
  datagram.say(R"({"tag":1,"anchor":3,"d":4000})");
  EXPECT_EQ(whole.sink.rows, datagram.sink.rows);
}

TEST(Ndjson, NamesTheOptionThatIsWrong) {
  Collect sink;
  device::Pipeline pipeline(sink);
  const auto why = [&](const std::string& options) {
    return pipeline
        .take({EventKind::added,
               1,
               {},
               device::to_json(device::Settings{"t", "ndjson", "", "tcp-listen://:0", options})})
        .error()
        .message;
  };
  EXPECT_EQ(why("{}"), "mapping: is needed: an object that gives the place of each value");
  EXPECT_EQ(why(R"({"format":"x"})"), "format: an ndjson device has mapping");
  EXPECT_NE(why(R"({"mapping":{"tag":"/t"}})").find("mapping/anchor: is needed"), std::string::npos);
  EXPECT_NE(
      why(R"({"mapping":{"topic":"a","tag":"/t","anchor":"/a","distance":{"pointer":"/d","unit":"m"}}})")
          .find("mapping/topic"),
      std::string::npos);
}

}  // namespace
}  // namespace anchord::mapping::ndjson_test
