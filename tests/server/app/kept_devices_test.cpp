// What stands in devices.json, whatever it is, costs at most the devices that it spoils.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>

#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "server/runtime/device_manager.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test::kept_devices_test {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr auto k_good =
    R"({"id":"01890000-0000-7000-8000-000000000001","kind":"gnss","name":"rover","address":"tcp://127.0.0.1:9","options":{},"enabled":true,"version":3})";

struct Nowhere final : DeviceRows {
  void live(const DeviceBatch&) override {}
  Result<void> store(const DeviceBatch&) override { return boost::outcome_v2::success(); }
};

/// A manager on a folder with this file in it.
struct Kept {
  explicit Kept(const std::string& text) {
    std::string pattern = (fs::temp_directory_path() / "anchord kept XXXXXX").string();
    folder = mkdtemp(pattern.data());
    std::ofstream(folder / "devices.json", std::ios::binary) << text;
    open();
  }
  ~Kept() {
    manager.reset();
    fs::remove_all(folder);
  }
  void open() {
    manager.reset();
    server::DeviceManagerOptions options;
    options.data_dir = folder;
    options.log = [this](const std::string& line) {
      const auto text = log.lock();
      *text += line + '\n';
    };
    auto opened = server::DeviceManager::open(std::move(options));
    ASSERT_TRUE(opened) << opened.error().message;
    manager = std::move(opened).value();
    manager->start(rows);
  }
  std::string file(const std::string& name = "devices.json") const {
    std::ifstream in(folder / name, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
  }
  Nowhere rows;
  fs::path folder;
  Locked<std::string> log;  ///< written by the devices' threads
  std::unique_ptr<server::DeviceManager> manager;
};

std::string list(const std::string& entries) {
  return R"({"schema":"anchord.devices/1","devices":[)" + entries + "]}";
}

TEST(KeptDevices, ASpoiltEntryCostsOnlyItselfAndSaysWhy) {
  const std::pair<std::string, std::string> k_cases[] = {
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"lidar","name":"x","address":"tcp://127.0.0.1:11"})",
       "no driver for \"lidar\""},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"gnss","name":"x","address":"nowhere"})",
       "begin with serial:"},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"gnss","name":"x","address":"tcp://127.0.0.1:9000","options":{"format":7}})",
       "one of auto"},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"ntrip","name":"x","address":"tcp://127.0.0.1:9000","options":{"version":{"a":[1]},"mount":"M"}})",
       "version: must be 1 or 2"},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":7,"name":"x","address":"tcp://127.0.0.1:9"})",
       "kind: not a string"},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"gnss","name":"x","address":"tcp://127.0.0.1:9","options":[]})",
       "options: not an object"},
      {R"({"id":"01890000-0000-7000-8000-000000000002","kind":"gnss","name":"x","address":"tcp://127.0.0.1:9","enabled":"yes"})",
       "enabled: not true or false"},
      {R"({"id":"rover","kind":"gnss","name":"x","address":"tcp://127.0.0.1:9"})", "id: not a UUID"},
      {R"({"id":"01890000-0000-7000-8000-000000000001","kind":"gnss","name":"x","address":"tcp://127.0.0.1:9"})",
       "another entry has the same"},
      {"17", "the entry is not an object"},
      {"{\"id\":\"01890000-0000-7000-8000-000000000002\",\"kind\":\"gnss\",\"name\":\"x\",\"address\":"
       "\"serial:/dev/\xff\"}",
       "address: holds bytes that are not UTF-8"},
  };
  for (const auto& [entry, why] : k_cases) {
    Kept kept(list(std::string(k_good) + "," + entry));
    const auto devices = kept.manager->devices();
    ASSERT_EQ(devices.size(), 2u) << entry;
    EXPECT_NE(devices[0].state, "off") << entry;  // the good one runs
    EXPECT_EQ(devices[1].state, "off");
    EXPECT_TRUE(devices[1].reason.starts_with("not started: ")) << devices[1].reason;
    EXPECT_NE(devices[1].reason.find(why), std::string::npos) << devices[1].reason;
    EXPECT_TRUE(devices[1].reason.ends_with("correct its settings or remove it")) << devices[1].reason;
    EXPECT_NE(kept.manager->not_started().find(why), std::string::npos);
    EXPECT_NE(kept.log.copy().find(why), std::string::npos);
    EXPECT_TRUE(is_utf8(kept.manager->not_started() + kept.log.copy()));
  }
}

TEST(KeptDevices, AnEntryThatCannotBeReadStaysInTheFileUntilSomebodyRemovesIt) {
  const std::string entry = R"({"id":"rover","kind":7,"mine":["keep",null,1.5]})";
  Kept kept(list(std::string(k_good) + "," + entry));
  DeviceConfig config;
  config.kind = "gnss";
  config.name = "another";
  config.address = "tcp://127.0.0.1:10";
  ASSERT_TRUE(kept.manager->add(config));
  const auto written = Json::parse(kept.file());
  ASSERT_EQ(written["devices"].size(), 3u);
  EXPECT_EQ(written["devices"][1], Json::parse(entry));
  EXPECT_EQ(kept.file("devices.json.unreadable-1"), list(std::string(k_good) + "," + entry));
  kept.open();
  auto devices = kept.manager->devices();
  ASSERT_EQ(devices.size(), 3u);
  ASSERT_TRUE(kept.manager->remove(devices[1].config.id, devices[1].config.version));
  EXPECT_EQ(kept.manager->not_started(), "");
  EXPECT_EQ(Json::parse(kept.file())["devices"].size(), 2u);
}

TEST(KeptDevices, ANameThatIsNotUtf8IsMendedAndItsDeviceRuns) {
  Kept kept(
      list("{\"id\":\"01890000-0000-7000-8000-000000000002\",\"kind\":\"gnss\",\"name\":\"M\xfcnchen\","
           "\"address\":\"tcp://127.0.0.1:9\"}"));
  const auto devices = kept.manager->devices();
  ASSERT_EQ(devices.size(), 1u);
  EXPECT_EQ(devices[0].config.name, "M\xef\xbf\xbdnchen");
  EXPECT_NE(devices[0].state, "off");
}

TEST(KeptDevices, CorrectingTheSettingsStartsTheDevice) {
  Kept kept(list(
      R"({"id":"01890000-0000-7000-8000-000000000002","kind":"lidar","name":"x","address":"tcp://127.0.0.1:9","version":4})"));
  auto config = kept.manager->devices().at(0).config;
  EXPECT_FALSE(kept.manager->change(config, 4));  // still no driver
  EXPECT_NE(kept.manager->not_started(), "");
  config.kind = "gnss";
  const auto changed = kept.manager->change(config, 4);
  ASSERT_TRUE(changed) << changed.error().message;
  EXPECT_NE(changed.value().state, "off");
  EXPECT_EQ(kept.manager->not_started(), "");
}

TEST(KeptDevices, AFileThatIsNoListStartsWithoutDevicesAndIsKept) {
  for (const std::string text :
       {"", "\xff\xfe\x00\x01", "{", "[]", "null", R"({"schema":7,"devices":[]})",
        R"({"schema":"anchord.devices/9","devices":[]})", R"({"schema":"anchord.devices/1","devices":{}})"}) {
    Kept kept(text);
    EXPECT_TRUE(kept.manager->devices().empty());
    EXPECT_NE(kept.manager->not_started().find("devices.json: not a list of devices"), std::string::npos)
        << text;
    EXPECT_NE(kept.log.copy().find("repair the file"), std::string::npos);
    EXPECT_EQ(kept.file(), text);
    DeviceConfig config;
    config.kind = "gnss";
    config.name = "rover";
    config.address = "tcp://127.0.0.1:9";
    ASSERT_TRUE(kept.manager->add(config));
    EXPECT_EQ(kept.file("devices.json.unreadable-1"), text);
    EXPECT_EQ(kept.manager->not_started(), "");
  }
}

}  // namespace
}  // namespace anchord::test::kept_devices_test
