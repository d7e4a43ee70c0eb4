// The subscriber behind the server's own entrance: what it says to a broker, and what it takes of one.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "drivers/device/settings.hpp"
#include "drivers/mqtt/packet.hpp"
#include "tests/drivers/device/collect.hpp"

namespace anchord::mqtt::subscriber_test {
namespace {

using namespace std::string_literals;
using device::test::Collect;
using Json = nlohmann::json;
using record::EventKind;

constexpr std::int64_t k_start_ns = 1'795'243'500'000'000'000;
constexpr std::int64_t k_s = 1'000'000'000;
const std::string k_ranges =
    R"({"mapping":{"topic":"uwb/+/ranges","tag":{"topic_level":2},"anchor":"/a","distance":{"pointer":"/d","unit":"m"}}})";

std::string packet(int type, int flags, const std::string& body) {
  std::string out(1, static_cast<char>(type << 4 | flags));
  std::size_t left = body.size();
  do {
    out += static_cast<char>((left & 0x7f) | (left > 0x7f ? 0x80 : 0));
    left >>= 7;
  } while (left > 0);
  return out + body;
}
std::string publish(const std::string& topic, const std::string& payload, int flags = 0) {
  return packet(3, flags,
                std::string{static_cast<char>(topic.size() >> 8), static_cast<char>(topic.size() & 0xff)} +
                    topic + ((flags & 6) != 0 ? "\x01\x02"s : ""s) + payload);
}

struct Device {
  explicit Device(const std::string& options) : pipeline(sink) {
    take(EventKind::added, device::to_json(device::Settings{"0190f1f2-0000-7000-8000-000000000abc", "mqtt",
                                                            "", "tcp://192.0.2.1:1883", options}));
  }
  /// Through the greeting, which is the standard's.
  void begin() {
    take(EventKind::opened);
    say("\x20\x02\0\0"s);
    say("\x90\x03\0\x01\0"s);
    sink.sent.clear();
  }
  void take(EventKind kind, std::string_view payload = {}) {
    const auto done = pipeline.take({kind, 1, {UtcTime{k_start_ns + now_ns}, now_ns}, payload});
    EXPECT_TRUE(done) << done.error().message;
  }
  void say(const std::string& bytes) { take(EventKind::bytes, bytes); }
  std::string sent() { return std::exchange(sink.sent[1], {}); }
  Collect sink;
  device::Pipeline pipeline;
  std::int64_t now_ns{k_s};
};

TEST(MqttSubscriber, ConnectsSubscribesAndMakesRangesOfMessages) {
  Device d(k_ranges);
  d.take(EventKind::opened);
  EXPECT_EQ(d.sent(), connect_packet({"anchord000000000abc", "", std::nullopt, 15}));
  d.say("\x20\x02\0\0"s);
  EXPECT_EQ(d.sent(), subscribe_packet(1, "uwb/+/ranges"));
  d.say("\x90\x03\0\x01\0"s);
  EXPECT_EQ(d.sink.heard_count, 1);
  d.say(publish("uwb/27183/ranges", R"({"a":2,"d":7.25})"));
  ASSERT_EQ(d.sink.ranges.size(), 1u);
  EXPECT_EQ(d.sink.ranges[0].tag, NetworkId{27183});
  EXPECT_DOUBLE_EQ(d.sink.ranges[0].distance_m, 7.25);
  EXPECT_EQ(d.sink.identities[1].model, "ranges from MQTT");
  d.say(publish("uwb/27183/ranges", R"({"a":2,"d":7.5})", 2));
  EXPECT_EQ(d.sent(), puback_packet(258));
  EXPECT_EQ(d.sink.ranges.size(), 2u);
}

TEST(MqttSubscriber, UsesNoKeptMessageAndNoTopicWithoutTheLevel) {
  Device d(k_ranges);
  d.begin();
  d.say(publish("uwb/27183/ranges", R"({"a":2,"d":7.25})", 1));
  d.say(publish("uwb", R"({"a":2,"d":7.25})"));
  d.say(publish("uwb/", R"({"a":2,"d":7.25})"));
  EXPECT_TRUE(d.sink.ranges.empty());
  EXPECT_EQ(d.sink.drops, (std::map<std::string, std::uint64_t>{{"retained", 1}, {"bad_tag", 2}}));
}

TEST(MqttSubscriber, PingsAQuietBrokerAndLeavesADeadOne) {
  Device d(k_ranges);
  d.begin();
  const int heard = d.sink.heard_count;
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(d.pipeline.deadline_ns(1));
    EXPECT_LT(*d.pipeline.deadline_ns(1) - d.now_ns, 2 * k_s) << "the supervisor's silence";
    d.now_ns = *d.pipeline.deadline_ns(1);
    d.take(EventKind::tick);
    EXPECT_EQ(d.sent(), ping_packet());
    d.say("\xd0\0"s);
  }
  EXPECT_EQ(d.sink.heard_count, heard + 3);
  for (int i = 0; i < 20 && d.sink.hung_up.empty(); ++i) {
    d.now_ns = *d.pipeline.deadline_ns(1);
    d.take(EventKind::tick);
  }
  EXPECT_EQ(d.sink.hung_up, "the broker no longer answers");
}

TEST(MqttSubscriber, SaysWhyABrokerIsOfNoUse) {
  const auto why = [](const std::string& bytes, std::int64_t wait_ns = 0) {
    Device d(k_ranges);
    d.take(EventKind::opened);
    if (!bytes.empty()) d.say(bytes);
    if (wait_ns > 0) {
      d.now_ns += wait_ns;
      d.take(EventKind::tick);
    }
    d.say(publish("uwb/1/ranges", R"({"a":2,"d":7.25})"));
    EXPECT_TRUE(d.sink.ranges.empty()) << "a connection that is given up makes no rows";
    return d.sink.hung_up;
  };
  EXPECT_EQ(why("\x20\x02\0\x04"s), "the broker rejects the user or the password");
  EXPECT_EQ(why("\x20\x02\0\x05"s), "the broker does not authorize this connection: check user and password");
  EXPECT_EQ(why("\x20\x02\0\x01"s), "the broker does not support MQTT 3.1.1");
  EXPECT_EQ(why("\x20\x02\0\0\x90\x03\0\x01\x80"s),
            "the broker rejects the subscription to \"uwb/+/ranges\"");
  EXPECT_EQ(why("HTTP/1.1 400 Bad Request\r\n\r\n"), "this is not an MQTT broker");
  EXPECT_EQ(why("\x20\x02\0\0\x40\x02\0\x01"s), "a packet of type 4, which a broker never sends");
  EXPECT_EQ(why("\x20\x03\0\0\0"s), "this is not an MQTT broker");
  EXPECT_EQ(why("", 10 * k_s), "no answer: is this an MQTT broker, without TLS?");
  EXPECT_EQ(why("\x20\x02\0\0"s, 10 * k_s), "no answer to the subscription");
}

TEST(MqttSubscriber, KeepsItsPasswordInAFileAndOutOfTheSettings) {
  const auto file = std::filesystem::temp_directory_path() / ("mqtt_password_" + std::to_string(::getpid()));
  std::ofstream(file) << "secret\n";
  Json options = Json::parse(k_ranges);
  options["user"] = "me";
  options["password_file"] = file.string();
  Device d(options.dump());
  d.take(EventKind::opened);
  EXPECT_EQ(d.sent(), connect_packet({"anchord000000000abc", "me", "secret", 15}));
  d.take(EventKind::closed);
  std::filesystem::remove(file);
  d.take(EventKind::opened);
  EXPECT_EQ(d.sent(), "") << "no connection without it, which would be refused";
  EXPECT_EQ(d.sink.hung_up, "the file of the password cannot be read: send the password again");
}

TEST(MqttSubscriber, NamesTheOptionThatIsWrong) {
  Collect sink;
  device::Pipeline pipeline(sink);
  const auto why = [&](const std::string& options) {
    const auto done =
        pipeline.take({EventKind::added,
                       1,
                       {},
                       device::to_json(device::Settings{"t", "mqtt", "", "tcp://192.0.2.1:1883", options})});
    return done ? "" : done.error().message;
  };
  EXPECT_EQ(why(k_ranges), "");
  EXPECT_EQ(why(R"({"format":"pozyx"})"), "");
  EXPECT_EQ(why("{}"), "mapping: is needed: an object that gives the place of each value");
  EXPECT_EQ(why(R"({"format":"omlox"})"), "format: must be one of mapping, pozyx");
  EXPECT_EQ(why(R"({"format":"pozyx","topic":"a#"})"), "topic: '#' must be the whole last level");
  EXPECT_EQ(why(R"({"qos":1})"),
            "qos: no such option: an mqtt device has format, mapping, topic, user, password");
  Json no_topic = Json::parse(k_ranges);
  no_topic["mapping"].erase("topic");
  EXPECT_EQ(why(no_topic.dump()), "mapping/topic: is needed, like \"uwb/+/ranges\"");
  no_topic["topic"] = "a/+";
  EXPECT_EQ(why(no_topic.dump()), "");
  no_topic["format"] = "pozyx";
  EXPECT_EQ(why(no_topic.dump()),
            "mapping: the format pozyx has a mapping of its own: remove one of the two");
}

// Recorded messages of C-Deck/CattleTrackerPozyx have this form; the numbers are those of
// protocols/pozyx-mqtt.md.
TEST(PozyxPositions, AreTheNewestOfEachTagInMetresAndNeverARow) {
  Device d(R"({"format":"pozyx"})");
  d.take(EventKind::opened);
  EXPECT_EQ(d.sent(), connect_packet({"anchord000000000abc", "", std::nullopt, 15}));
  d.say("\x20\x02\0\0"s);
  EXPECT_EQ(d.sent(), subscribe_packet(1, "tags/#"));
  d.say("\x90\x03\0\x01\0"s);
  const auto update = [](const char* tag, double time, int x) {
    return Json{{"version", "1"},
                {"alive", true},
                {"tagId", tag},
                {"success", true},
                {"timestamp", time},
                {"data",
                 {{"tagData", Json::object()},
                  {"anchorData", Json::array()},
                  {"coordinates", {{"x", x}, {"y", 44505}, {"z", 783}}},
                  {"orientation", {{"yaw", 3.437}, {"roll", -0.003}, {"pitch", -0.036}}},
                  {"metrics", {{"latency", 33.6}, {"rates", {{"update", 12.9}, {"success", 12.9}}}}}}}};
  };
  d.say(publish("tags", Json::array({update("27196", 1589960921.2, 11680)}).dump()));
  // A batch out of order.
  d.say(publish("tags/27197",
                Json::array({update("27197", 1589960922.0, 2), update("27197", 1589960921.0, 1)}).dump()));
  d.say(publish(
      "tags",
      R"([{"version":"1","alive":true,"tagId":"27196","success":false,"timestamp":1589960922.01,)"
      R"("errorCode":"3","data":{"metrics":{"latency":21,"rates":{"update":12.9,"success":11.8}}}}])"));
  EXPECT_TRUE(d.sink.ranges.empty());
  EXPECT_TRUE(d.sink.fixes.empty());
  d.take(EventKind::command, device::to_json(device::Command{7, "positions", ""}));
  const auto got = Json::parse(d.sink.answers.at(7));
  ASSERT_EQ(got.size(), 2u);
  EXPECT_EQ(got[0]["tag"], "27196");
  EXPECT_EQ(got[0]["t_us"], 1589960921200000);
  EXPECT_NEAR(got[0]["local_m"][0].get<double>(), 11.680, 1e-9);
  EXPECT_NEAR(got[0]["local_m"][1].get<double>(), 44.505, 1e-9);
  EXPECT_NEAR(got[0]["yaw_deg"].get<double>(), 196.9256, 1e-3);  // 3.437 rad
  EXPECT_NEAR(got[1]["local_m"][0].get<double>(), 0.002, 1e-9) << "the newest, not the last";
  d.take(EventKind::command, device::to_json(device::Command{8, "reboot", ""}));
  EXPECT_TRUE(d.sink.answers.at(8).starts_with("error: ")) << d.sink.answers.at(8);
  EXPECT_EQ(d.sink.drops, (std::map<std::string, std::uint64_t>{{"failed", 1}}));
}

TEST(PozyxPositions, RefuseWhatIsNoUpdate) {
  const auto drops = [](const std::string& payload) {
    Device d(R"({"format":"pozyx"})");
    d.begin();
    d.say(publish("tags", payload));
    std::string out;
    for (const auto& [reason, n] : d.sink.drops) out += reason + ' ' + std::to_string(n) + ' ';
    return out;
  };
  EXPECT_EQ(drops("{}"), "not_json 1 ");
  EXPECT_EQ(drops(std::string(5000, '[')), "too_deep 1 ");
  EXPECT_EQ(drops("[\"\xff\"]"), "not_utf8 1 ");
  EXPECT_EQ(drops("[" + std::string(300'000, ' ') + "]"), "too_large 1 ");
  EXPECT_EQ(
      drops(R"([1,null,{},{"tagId":5,"timestamp":1},{"tagId":"5"},{"tagId":"5","timestamp":1589960921}])"),
      "bad_update 6 ");
  EXPECT_EQ(drops(R"([{"tagId":"5","timestamp":1589960921,"data":{"coordinates":{"x":"1","y":2,"z":3}}}])"),
            "bad_update 1 ");
  EXPECT_EQ(drops(R"([{"tagId":"5","timestamp":12,"data":{"coordinates":{"x":1,"y":2,"z":3}}}])"),
            "time_not_set 1 ");
  EXPECT_EQ(drops(R"([{"tagId":"5","timestamp":1e300,"data":{"coordinates":{"x":1,"y":2,"z":3}}}])"),
            "time_not_set 1 ");
}

}  // namespace
}  // namespace anchord::mqtt::subscriber_test
