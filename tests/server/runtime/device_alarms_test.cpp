#include "server/runtime/device_alarms.hpp"

#include <gtest/gtest.h>

#include <fstream>

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
}

}  // namespace
}  // namespace anchord::server::device_alarms_test
