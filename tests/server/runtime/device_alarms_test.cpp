#include "server/runtime/device_alarms.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "server/runtime/device_news.hpp"
#include "tests/scratch_dir.hpp"

namespace anchord::server::device_alarms_test {
namespace {

namespace fs = std::filesystem;

TEST(DeviceAlarms, RecordingsThatFillTheDiskNameTheirFolderAndTheDeviceThatWritesMost) {
  const ScratchDir dir;
  std::vector<device::DeviceState> devices(2);
  devices[0].settings.name = "tag";
  devices[0].recorded = 5000;
  devices[1].settings.name = "junk";
  devices[1].recorded = 900'000'000;
  EXPECT_EQ(recordings_on_disk(dir.path(), devices), "");
  std::ofstream(dir.path() / "a-0001.anrec") << "x";
  fs::resize_file(dir.path() / "a-0001.anrec", (std::uintmax_t{2} << 30) + 5);  // a hole, no bytes
  EXPECT_EQ(recordings_on_disk(dir.path(), devices),
            "raw recordings take more than 2 GiB of it in " + dir.path().string() +
                ", and device \"junk\" has written most since the start");
  EXPECT_EQ(recordings_on_disk(dir.path() / "none", devices), "");
}

TEST(DeviceAlarms, EachDeviceThatSendsTooManyIdsOrWhoseBaseMovedIsNamed) {
  std::vector<device::DeviceState> devices(3);
  for (const char* name : {"a", "b", "c"})
    devices[static_cast<std::size_t>(*name - 'a')].settings.name = name;
  EXPECT_EQ(too_many_ids(devices), "");
  devices[1].too_many_ids = "it sends many";
  devices[2].too_many_ids = "it sends more";
  EXPECT_EQ(too_many_ids(devices), "device \"b\": it sends many; device \"c\": it sends more");
  EXPECT_EQ(moved_bases(devices), "");
  devices[0].moved_base = "its base moved";
  EXPECT_EQ(moved_bases(devices), "device \"a\": its base moved");
  EXPECT_EQ(unused_sources(devices), "");
  devices[2].unused = "another one is used";
  EXPECT_EQ(unused_sources(devices), "device \"c\": another one is used");
}

TEST(DeviceNews, OfADeviceThatIsNotThereAreALineOfEachKindAndThenOneInTenMinutesWithTheirNumber) {
  DeviceNews news;
  std::vector<std::string> log;
  // Every 3.5 s it is found and lost again, for half an hour.
  for (std::int64_t ms = 0; ms < 1'800'000; ms += 1750) {
    const std::string text = ms % 3500 == 0 ? "is lost: refused" : "is found: refused";
    if (const auto line = news.line(text, false, {ms * 1'000'000})) log.push_back(*line);
  }
  ASSERT_EQ(log.size(), 4U);
  EXPECT_EQ(log[0], "is lost: refused");
  EXPECT_EQ(log[1], "is found: refused");
  EXPECT_EQ(log[2], "is lost: refused (172 times since this was last logged)");
  EXPECT_EQ(log[3], "is found: refused (343 times since this was last logged)");
}

TEST(DeviceNews, OfADeviceThatWorkedForAMinuteAreNewAgain) {
  DeviceNews news;
  const auto at = [](std::int64_t s) { return SteadyTime{s * 1'000'000'000}; };
  EXPECT_TRUE(news.line("is talking", true, at(0)));
  EXPECT_FALSE(news.line("is talking", true, at(1))) << "the same twice";
  EXPECT_TRUE(news.line("is lost: pulled", false, at(5)));
  EXPECT_FALSE(news.line("is talking", true, at(7)));
  EXPECT_FALSE(news.line("is lost: pulled", false, at(30))) << "it worked for less than a minute";
  EXPECT_FALSE(news.line("is talking", true, at(40)));
  EXPECT_TRUE(news.line("is lost: pulled", false, at(101)));
  EXPECT_TRUE(news.line("is talking", true, at(102)));
}

}  // namespace
}  // namespace anchord::server::device_alarms_test
