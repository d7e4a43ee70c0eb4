// The server with a receiver of its own: set up over REST, heard over TCP, stored, seen, taken out.
#include <algorithm>
#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "api/wire/rows_json.hpp"
#include "core/base/time.hpp"
#include "drivers/device/replay.hpp"
#include "drivers/sim/rig.hpp"
#include "server/runtime/device_manager.hpp"
#include "tests/server/app/rover_fixture.hpp"

namespace anchord::test::devices_over_http_test {
namespace {

TEST(DevicesOverHttp, ARoverSetUpOverRestIsHeardAndItsPositionsAreOfTheMissionThatRecords) {
  Receiver receiver;
  Rover server;
  ASSERT_TRUE(server.app) << server.error.message;
  const auto made = server.ask("POST", "/api/v1/devices",
                               {{"kind", "gnss"}, {"name", "rover"}, {"address", receiver.address()}});
  ASSERT_EQ(server.last.status, 201) << server.last.body;
  const std::string path = server.last.headers.at("location"), etag = server.last.headers.at("etag");
  const auto talking = server.until(path, [](const Json& d) { return d.value("state", "") == "talking"; });
  EXPECT_EQ(talking.value("state", ""), "talking") << talking;
  const auto mission = server.ask("POST", "/api/v1/missions",
                                  {{"name", "flight"}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}});
  ASSERT_EQ(server.last.status, 201) << server.last.body;
  const std::string id = mission.value("id", "");
  const auto fixes =
      server.until("/api/v1/fixes?mission=" + id, [](const Json& page) { return page["items"].size() >= 5; });
  ASSERT_GE(fixes["items"].size(), 5u) << fixes;
  const Json& fix = fixes["items"][0];
  EXPECT_EQ(fix.value("fix", ""), "fixed");
  EXPECT_NEAR(fix.value("lat", 0.0), 51.0228123, 1e-9);  // section 7 of the NMEA sheet
  EXPECT_NEAR(fix.value("h_m", 0.0), 67.512, 1e-6);
  const auto told = server.ask("GET", path);
  EXPECT_EQ(told["rover"].value("fix", ""), "fixed");
  EXPECT_EQ(told["rover"].value("satellites", 0), 14);
  EXPECT_NE(server.call("GET", "/metrics").body.find("anchord_device_talking"), std::string::npos);

  // Switched off it keeps its settings; an old ETag is refused.
  const auto off = server.ask("PATCH", path, {{"enabled", false}}, {{"If-Match", etag}});
  EXPECT_EQ(server.last.status, 200) << server.last.body;
  EXPECT_EQ(off.value("state", ""), "off");
  server.ask("PATCH", path, {{"enabled", true}}, {{"If-Match", etag}});
  EXPECT_EQ(server.last.status, 412);
  server.ask("DELETE", path, nullptr, {{"If-Match", "*"}});
  EXPECT_EQ(server.last.status, 204);
  server.ask("GET", path);
  EXPECT_EQ(server.last.status, 404);
}

TEST(DevicesOverHttp, RefusesWhatNoDriverTakesAndTheSameAddressTwice) {
  Rover server;
  ASSERT_TRUE(server.app) << server.error.message;
  for (const Json& body :
       {Json{{"kind", "gnss"}, {"address", "teapot:1"}}, Json{{"kind", "gnss"}},
        Json{{"kind", "toaster"}, {"address", "tcp://127.0.0.1:1"}},
        Json{{"kind", "gnss"}, {"address", "tcp://127.0.0.1:1"}, {"colour", "red"}},
        Json{{"kind", "gnss"}, {"address", "tcp://127.0.0.1:1"}, {"options", {{"format", "x"}}}},
        Json{{"kind", "pozyx"}, {"address", "tcp://127.0.0.1:1"}, {"options", {{"cir", "x"}}}}}) {
    server.ask("POST", "/api/v1/devices", body);
    EXPECT_EQ(server.last.status, 422) << body << server.last.body;
    // Switched off it would be found out by whoever switches it on, in the field.
    Json off = body;
    off["enabled"] = false;
    server.ask("POST", "/api/v1/devices", off);
    EXPECT_EQ(server.last.status, 422) << off << server.last.body;
  }
  const Json good{{"kind", "gnss"}, {"address", "serial:/dev/serial/by-id/nothing"}};
  const auto made = server.ask("POST", "/api/v1/devices", good);
  ASSERT_EQ(server.last.status, 201) << server.last.body;
  // Found until the first try to open it has failed: which of the two the answer says is a matter of speed.
  const auto lost = server.until("/api/v1/devices/" + made.value("id", ""),
                                 [](const Json& d) { return d.value("state", "") == "lost"; });
  EXPECT_EQ(lost.value("state", ""), "lost") << lost;
  server.ask("POST", "/api/v1/devices", good);
  EXPECT_EQ(server.last.status, 409) << server.last.body;
  server.ask("POST", "/api/v1/devices/" + made.value("id", "") + "/actions", {{"action", "identify"}});
  EXPECT_EQ(server.last.status, 422) << "it is not connected";
}

TEST(DeviceManager, SaysOnceThatADeviceTalksAndOnceThatItIsGone) {
  struct Nowhere final : DeviceRows {
    void live(const DeviceBatch&) override {}
    Result<void> store(const DeviceBatch&) override { return boost::outcome_v2::success(); }
  } nowhere;
  std::mutex mutex;
  std::vector<std::string> lines;
  const auto count = [&](const std::string& part) {
    const std::scoped_lock lock(mutex);
    return std::count_if(lines.begin(), lines.end(),
                         [&](const auto& line) { return line.find(part) != std::string::npos; });
  };
  std::string pattern = (std::filesystem::temp_directory_path() / "anchord_manager_XXXXXX").string();
  const std::filesystem::path folder = mkdtemp(pattern.data());
  {
    auto receiver = std::make_unique<Receiver>();
    server::DeviceManagerOptions options;
    options.data_dir = folder;
    options.log = [&](const std::string& text) {
      const std::scoped_lock lock(mutex);
      lines.push_back(text);
    };
    auto manager = std::move(server::DeviceManager::open(std::move(options))).value();
    manager->start(nowhere);
    DeviceConfig config;
    config.kind = "gnss";
    config.name = "rover";
    config.address = receiver->address();
    const auto id = manager->add(config).value().config.id;
    const auto until = [&](const std::string& part, const auto& so) {
      const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
      while ((count(part) == 0 || !so(manager->device(id).value())) && std::chrono::steady_clock::now() < end)
        std::this_thread::sleep_for(std::chrono::milliseconds(5));
    };
    until("is talking", [](const DeviceReport& d) { return !d.model.empty() && d.frames > 10; });
    EXPECT_EQ(count("device \"rover\" is talking"), 1);
    receiver.reset();
    until("is lost", [](const DeviceReport& d) { return d.state == "lost"; });
    manager->stop();
  }
  EXPECT_EQ(count("device \"rover\" is talking"), 1);
  std::filesystem::remove_all(folder);
}

TEST(DevicesOverHttp, AServerStartedAgainKnowsItsDevices) {
  Receiver receiver;
  Rover server;
  ASSERT_TRUE(server.app) << server.error.message;
  server.ask("POST", "/api/v1/devices", {{"kind", "gnss"}, {"name", "r"}, {"address", receiver.address()}});
  ASSERT_EQ(server.last.status, 201);
  server.app.reset();
  const auto config = server::load_config(
      Settings{{"listen", "127.0.0.1:0"}, {"auth", "off"}, {"data_dir", (server.folder / "data").string()}},
      std::nullopt, {});
  server.app = std::move(server::App::start(config.value())).value();
  server.url = server.app->urls().front();
  const auto list = server.until("/api/v1/devices", [](const Json& page) {
    return !page["items"].empty() && page["items"][0].value("state", "") == "talking";
  });
  ASSERT_EQ(list["items"].size(), 1u);
  EXPECT_EQ(list["items"][0].value("state", ""), "talking") << list;
  EXPECT_TRUE(std::filesystem::exists(server.folder / "data" / "recordings"));
}

/// Lines without their leading row id, sorted: the database orders by time, the recording by arrival.
std::vector<std::string> sorted_lines(const std::string& text) {
  std::vector<std::string> out;
  for (std::size_t at = 0; at < text.size();) {
    const auto end = text.find('\n', at);
    std::string line = text.substr(at, end - at);
    if (line.starts_with("{\"id\":")) line = "{" + line.substr(line.find(',') + 1);
    out.push_back(std::move(line));
    at = end + 1;
  }
  std::sort(out.begin(), out.end());
  return out;
}

// A simulated tag and a simulated rover through links, supervisors, drivers, recorder, queue and database;
// then the recording alone through the drivers again.
TEST(DevicesOverHttp, ARecordingGivesTheRowsThatWereStoredByteForByte) {
  Rover server;
  ASSERT_TRUE(server.app) << server.error.message;
  sim::RigOptions options;
  options.links_folder = server.folder.string();
  auto rig = sim::Rig::open(std::make_shared<const sim::Scenario>(sim::demonstration_scenario()), options);
  ASSERT_TRUE(rig) << rig.error().message;
  std::atomic<bool> stop{false};
  std::thread flying([&] {
    while (!stop) rig.value()->step(20);
  });
  for (const auto& device : rig.value()->devices()) {
    server.ask("POST", "/api/v1/devices",
               {{"kind", device.kind}, {"name", device.name}, {"address", device.address}});
    EXPECT_EQ(server.last.status, 201) << server.last.body;
  }
  const auto mission = server.ask("POST", "/api/v1/missions",
                                  {{"name", "flight"}, {"frame", "wgs84"}, {"track_point", "gnss_antenna"}});
  const std::string id = mission.value("id", ""), of_mission = "?format=ndjson&mission=" + id;
  const auto ranges = server.until("/api/v1/ranges?limit=30&mission=" + id,
                                   [](const Json& page) { return page["items"].size() >= 30; });
  EXPECT_GE(ranges["items"].size(), 30u);
  server.ask("POST", "/api/v1/missions/" + id + "/actions", {{"action", "finish"}});
  EXPECT_EQ(server.last.status, 200) << server.last.body;
  server.app.reset();
  stop = true;
  flying.join();

  std::string fixes_again, ranges_again;
  std::filesystem::path first;
  for (const auto& entry : std::filesystem::directory_iterator(server.folder / "data" / "recordings"))
    if (first.empty() || entry.path() < first) first = entry.path();
  const MissionId wanted{parse_uuid(id).value()};
  const device::ReplayRows rows{[&](const Fix& row) -> Result<void> {
                                  if (row.mission == wanted)
                                    fixes_again += api::fix_json(row, std::nullopt).dump() + '\n';
                                  return boost::outcome_v2::success();
                                },
                                [&](const Range& row) -> Result<void> {
                                  if (row.mission == wanted)
                                    ranges_again += api::range_json(row, std::nullopt).dump() + '\n';
                                  return boost::outcome_v2::success();
                                }};
  const auto replayed = device::replay(first, rows);
  ASSERT_TRUE(replayed) << replayed.error().message;
  EXPECT_EQ(replayed.value().unreadable_bytes, 0u);

  const auto config = server::load_config(
      Settings{{"listen", "127.0.0.1:0"}, {"auth", "off"}, {"data_dir", (server.folder / "data").string()}},
      std::nullopt, {});
  server.app = std::move(server::App::start(config.value())).value();
  server.url = server.app->urls().front();
  EXPECT_EQ(sorted_lines(server.call("GET", "/api/v1/fixes" + of_mission).body), sorted_lines(fixes_again));
  const auto stored = sorted_lines(server.call("GET", "/api/v1/ranges" + of_mission + "&cir=true").body);
  EXPECT_GE(stored.size(), 30u);
  EXPECT_EQ(stored, sorted_lines(ranges_again));
}

}  // namespace
}  // namespace anchord::test::devices_over_http_test
