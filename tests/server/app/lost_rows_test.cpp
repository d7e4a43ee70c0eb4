// Rows of devices that leave memory because the disk stands still: the alarm, and the way back that it names.
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <set>

#include "tests/paths.hpp"
#include "tests/server/app/rover_fixture.hpp"
#include "tests/server/storage/stuck_disk.hpp"

namespace anchord::test::lost_rows_test {
namespace {

/// What the real program prints on standard output.
std::string printed(const std::string& arguments) {
  std::string out;
  FILE* pipe = popen((std::string("'") + ANCHORD_BINARY + "' " + arguments + " 2>/dev/null").c_str(), "r");
  if (pipe == nullptr) return out;
  std::array<char, 4096> chunk{};
  for (std::size_t n = 0; (n = std::fread(chunk.data(), 1, chunk.size(), pipe)) > 0;)
    out.append(chunk.data(), n);
  EXPECT_EQ(pclose(pipe), 0) << arguments;
  return out;
}

/// The time of each fix of the mission, of rows as NDJSON.
std::multiset<std::int64_t> times_of(const std::string& rows, const std::string& mission) {
  std::multiset<std::int64_t> out;
  for (std::size_t at = 0, end = 0; (end = rows.find('\n', at)) != std::string::npos; at = end + 1) {
    const Json row = Json::parse(rows.substr(at, end - at), nullptr, false);
    if (row.is_object() && row.contains("lat") && row.value("mission", mission) == mission)
      out.insert(row["t_us"].get<std::int64_t>());
  }
  return out;
}

TEST(LostRows, AreAnAlarmWithTheirNumberAndComeBackFromTheRecordingThatItNames) {
  Receiver receiver;
  StuckDisk disk;
  Rover server(Settings{{"storage.device_queue", "20"}});
  ASSERT_TRUE(server.app) << server.error.message;
  const auto lost = [&]() -> std::string {
    const Json now = server.ask("GET", "/api/v1/alarms");
    for (const auto& alarm : now["items"])
      if (alarm["id"] == "rows.lost") return alarm["text"];
    return {};
  };
  const auto device =
      server.ask("POST", "/api/v1/devices", {{"kind", "gnss"}, {"address", receiver.address()}});
  ASSERT_EQ(server.last.status, 201) << server.last.body;
  const std::string path = "/api/v1/devices/" + device.value("id", "");
  const std::string id = server
                             .ask("POST", "/api/v1/missions",
                                  {{"name", "flight"}, {"frame", "wgs84"}, {"track_point", "tag_antenna"}})
                             .value("id", "");
  const auto stored = [&] {
    return times_of(server.call("GET", "/api/v1/fixes?format=ndjson&mission=" + id).body, id);
  };
  server.until("/api/v1/fixes?mission=" + id, [](const Json& page) { return page["items"].size() >= 3; });
  EXPECT_EQ(lost(), "");

  StuckDisk::stuck = true;
  const Json alarms = server.until("/api/v1/alarms", [&](const Json&) { return !lost().empty(); });
  ASSERT_NE(lost(), "") << alarms;
  StuckDisk::stuck = false;
  server.ask("PATCH", path, {{"enabled", false}}, {{"If-Match", "*"}});
  ASSERT_EQ(server.last.status, 200) << server.last.body;
  const std::string recordings = (server.folder / "data" / "recordings").string();
  const auto recorded = times_of(printed("replay '" + recordings + "/'*.anrec"), id);
  const auto missing = [&] {
    const auto there = stored();
    return std::ranges::count_if(recorded, [&](std::int64_t t_us) { return !there.contains(t_us); });
  };
  std::string text;
  const auto agrees = [&] {
    text = lost();
    return text.starts_with(std::to_string(missing()) + " measurements of devices have not been stored");
  };
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!agrees() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_TRUE(agrees()) << text << ", missing: " << missing();
  EXPECT_GT(missing(), 0);
  EXPECT_NE(text.find(recordings), std::string::npos) << text;
  EXPECT_NE(text.find("anchord replay RECORDING --url URL"), std::string::npos) << text;

  printed("replay '" + recordings + "/'*.anrec --url " + server.url);
  EXPECT_EQ(stored(), recorded) << "each once";
}

}  // namespace
}  // namespace anchord::test::lost_rows_test
