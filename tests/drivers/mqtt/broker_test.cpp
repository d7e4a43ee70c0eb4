// A real Eclipse Mosquitto between mosquitto_pub and our driver, recorded and replayed.
#include <gtest/gtest.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <filesystem>

#include "drivers/device/device_loop.hpp"
#include "drivers/device/replay.hpp"
#include "drivers/record/recorder.hpp"
#include "tests/server/mqtt/mosquitto.hpp"

namespace anchord::mqtt::broker_test {
namespace {

namespace fs = std::filesystem;
using test::Mosquitto;

struct Rows final : device::DeviceListener {
  void fix(const std::string&, const Fix&) override {}
  void range(const std::string&, const Range& row) override { ranges.push_back(row); }
  void changed(const std::string&) override {}
  void answer(const std::string&, std::uint64_t, const Result<std::string>&) override {}
  std::vector<Range> ranges;
};

TEST(MqttDevice, ReadsRangesOfARealBrokerOverItsRestartAndReplaysThem) {
  if (!Mosquitto::installed()) GTEST_SKIP() << "SKIP: mosquitto is not installed";
  Mosquitto mosquitto;
  ASSERT_TRUE(mosquitto.start());
  const auto folder = fs::temp_directory_path() / ("anchord_mqtt_device_" + std::to_string(::getpid()));
  fs::path recording;
  Rows rows;
  {
    auto recorder = record::Recorder::open(folder, SystemClock{}.now(), {}).value();
    recording = recorder->file();
    boost::asio::io_context io{1};
    device::LoopOptions quick;
    quick.supervisor.first_wait_ns = 2'000'000;
    quick.supervisor.longest_wait_ns = 20'000'000;
    device::DeviceLoop loop(io, recorder.get(), rows, quick);
    loop.record_into(MissionId{Uuid{{1}}});
    const std::string options =
        R"({"mapping":{"topic":"uwb/+/ranges","array":"/r","tag":{"topic_level":2},"anchor":"/id",)"
        R"("distance":{"pointer":"/mm","unit":"mm"},"rss":"/dbm"}})";
    const auto added =
        loop.add({"d", "mqtt", "d", "tcp://127.0.0.1:" + std::to_string(mosquitto.port()), options});
    ASSERT_TRUE(added) << added.error().message;
    const auto run_until = [&](const auto& holds) {
      return test::eventually([&] {
        io.restart();
        io.poll();
        return holds();
      });
    };
    const auto talking = [&] { return loop.device("d")->phase == device::Phase::talking; };
    const auto publish = [&] {
      return test::output_of(
          "mosquitto_pub -h 127.0.0.1 -p " + std::to_string(mosquitto.port()) +
          R"( -t uwb/27183/ranges -m '{"r":[{"id":"0x6a3c","mm":7412,"dbm":-84.3},{"id":9}]}')");
    };
    ASSERT_TRUE(run_until(talking)) << loop.device("d")->reason;
    EXPECT_EQ(publish(), "");
    ASSERT_TRUE(run_until([&] { return rows.ranges.size() == 1; }));
    EXPECT_EQ(rows.ranges[0].tag, NetworkId{27183});
    EXPECT_DOUBLE_EQ(rows.ranges[0].distance_m, 7.412);
    EXPECT_DOUBLE_EQ(rows.ranges[0].rss_dbm.value_or(0), -84.3);
    EXPECT_EQ(loop.device("d")->dropped.at("bad_distance"), 1u);
    mosquitto.kill_now();
    ASSERT_TRUE(run_until([&] { return loop.device("d")->phase == device::Phase::lost; }));
    ASSERT_TRUE(mosquitto.start());
    ASSERT_TRUE(run_until(talking)) << loop.device("d")->reason;
    EXPECT_EQ(publish(), "");
    ASSERT_TRUE(run_until([&] { return rows.ranges.size() == 2; }));
  }
  std::vector<Range> again;
  const auto replayed =
      device::replay(recording, {[](const Fix&) -> Result<void> { return boost::outcome_v2::success(); },
                                 [&](const Range& row) -> Result<void> {
                                   again.push_back(row);
                                   return boost::outcome_v2::success();
                                 }});
  ASSERT_TRUE(replayed) << replayed.error().message;
  ASSERT_EQ(again.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(again[i].time, rows.ranges[i].time);
    EXPECT_EQ(again[i].distance_m, rows.ranges[i].distance_m);
  }
  fs::remove_all(folder);
}

}  // namespace
}  // namespace anchord::mqtt::broker_test
