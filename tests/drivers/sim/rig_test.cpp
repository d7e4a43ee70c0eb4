// Simulated devices on real ptys and sockets, and the server's own device loop at the other end.
#include "drivers/sim/rig.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <boost/asio/io_context.hpp>
#include <chrono>
#include <filesystem>
#include <map>
#include <random>
#include <thread>

#include "drivers/device/device_loop.hpp"
#include "drivers/sim/rover_formats.hpp"

namespace anchord::sim::rig_test {
namespace {

namespace fs = std::filesystem;

std::size_t entries_of(const char* folder) {
  std::size_t n = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder)) ++n;
  return n;
}

struct Rows final : device::DeviceListener {
  void fix(const std::string& id, const Fix& row) override { fixes[id].push_back(row); }
  void range(const std::string& id, const Range& row) override { ranges[id].push_back(row); }
  void changed(const std::string&) override {}
  void answer(const std::string&, std::uint64_t, const Result<std::string>&) override {}
  std::map<std::string, std::vector<Fix>> fixes;
  std::map<std::string, std::vector<Range>> ranges;
};

/// A scenario being served by this thread, together with a device loop that has each of its devices.
class Bench {
 public:
  explicit Bench(Scenario scenario) {
    std::string pattern = (fs::temp_directory_path() / "anchord_rig_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    RigOptions options;
    options.links_folder = folder_.string();
    auto opened = Rig::open(std::make_shared<const Scenario>(std::move(scenario)), options);
    EXPECT_TRUE(opened) << opened.error().message;
    rig = std::move(opened).value();
    device::LoopOptions loop_options;
    loop_options.presence_poll_ms = 10;
    loop_options.supervisor.first_wait_ns = 10'000'000;
    loop_options.supervisor.longest_wait_ns = 50'000'000;
    loop = std::make_unique<device::DeviceLoop>(io, nullptr, rows, loop_options);
    loop->record_into(MissionId{Uuid{{1}}});
    for (const auto& device : rig->devices()) {
      const auto added = loop->add({device.name, device.kind, device.name, device.address,
                                    device.kind == "pozyx" ? R"({"cir":"none"})" : "{}"});
      EXPECT_TRUE(added) << added.error().message;
    }
  }
  ~Bench() {
    loop.reset();
    rig.reset();
    fs::remove_all(folder_);
  }
  /// Turns both sides until it is so; false when that takes more than 60 s.
  bool until(const std::function<bool()>& so) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      io.restart();
      io.poll();
      rig->step(1);
    }
    return true;
  }
  boost::asio::io_context io{1};
  Rows rows;
  std::unique_ptr<Rig> rig;
  std::unique_ptr<device::DeviceLoop> loop;

 private:
  fs::path folder_;
};

TEST(Rig, ServesATagAndARoverOfEachFormatToTheRealDrivers) {
  Scenario scenario = demonstration_scenario();
  scenario.rovers.clear();
  for (const RoverFormat format :
       {RoverFormat::nmea, RoverFormat::ubx, RoverFormat::erb, RoverFormat::llh, RoverFormat::gpsd}) {
    for (const RoverPort port : {RoverPort::pty, RoverPort::tcp}) {
      if (format == RoverFormat::gpsd && port == RoverPort::pty) continue;  // a gpsd is a socket
      RoverSetup& rover = scenario.rovers.emplace_back();
      rover.format = format;
      rover.port = port;
      rover.rate_hz = 20;
      rover.name = std::string(to_string(format)) + (port == RoverPort::pty ? "_pty" : "_tcp");
    }
  }
  Bench bench(scenario);
  bench.loop->record_into(std::nullopt);  // of all, one alone would give the track
  const bool all = bench.until([&] {
    for (const auto& rover : scenario.rovers) {
      if (bench.loop->device(rover.name)->fixes < 5) return false;
    }
    return bench.loop->device("tag")->ranges >= 20;
  });
  for (const auto& device : bench.loop->devices())
    EXPECT_EQ(device.phase, device::Phase::talking) << device.settings.name << ": " << device.reason;
  EXPECT_TRUE(all);
  for (const auto& rover : scenario.rovers)
    EXPECT_EQ(bench.loop->device(rover.name)->rover->fix, FixClass::rtk_fixed) << rover.name;
}

/// A host that opens a simulated tag's pty by hand, in the thread that turns the rig.
class RawHost {
 public:
  RawHost(Rig& rig, const std::string& path)
      : rig_(rig), fd_(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK)) {
    EXPECT_GE(fd_, 0) << path;
    rig_.step(10);  // where the rig sees it arrive
  }
  ~RawHost() { ::close(fd_); }
  void say(std::string_view bytes) {
    EXPECT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  /// Its answer, without CR LF; empty after 10 s.
  std::string ask(const std::string& question) {
    say(question + "\r");
    std::string answer;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (!answer.ends_with("\r\n") && std::chrono::steady_clock::now() < end) {
      rig_.step(1);
      std::array<char, 512> buffer{};
      const auto n = ::read(fd_, buffer.data(), buffer.size());
      if (n > 0) answer.append(buffer.data(), static_cast<std::size_t>(n));
    }
    return answer.substr(0, answer.find('\r'));
  }

 private:
  Rig& rig_;
  int fd_;
};

TEST(Rig, DoesWhatAHostSaidBeforeItClosedThePortAndTellsTheNextOneNothingOfIt) {
  auto rig = Rig::open(std::make_shared<const Scenario>(demonstration_scenario()), {}).value();
  const std::string path = rig->devices().at(0).pty;
  {
    RawHost host(*rig, path);
    host.say("W,15,2a\rR,00,1\rR,0");
  }
  rig->step(10);
  for (int i = 0; i < 3; ++i) {
    RawHost host(*rig, path);
    EXPECT_EQ(host.ask("R,15,1"), "D,2A");
  }
}

TEST(Rig, HasTagsThatHearEachOther) {
  Scenario scenario = demonstration_scenario();
  scenario.radio.loss_chance = scenario.radio.zero_chance = 0;
  TagSetup& other = scenario.tags.emplace_back(scenario.tags[0]);
  other.name = "other";
  other.id = {0x6e02};
  other.lever_arm_m.x() += 1;
  auto rig = Rig::open(std::make_shared<const Scenario>(scenario), {}).value();
  RawHost first(*rig, rig->devices().at(0).pty), second(*rig, rig->devices().at(1).pty);
  EXPECT_EQ(first.ask("F,b2,0041,1"), "D,01");
  EXPECT_EQ(first.ask("F,b3,026e06,1"), "D,01");  // data to 0x6e02
  std::string events;
  for (int i = 0; i < 10'000 && events != "D,08"; ++i) events = second.ask("R,05,1");
  EXPECT_EQ(second.ask("R,82,3"), "D,016E01");
  EXPECT_EQ(second.ask("F,b4,0001,2"), "D,0141");
}

TEST(Rig, LeavesTheLinkToWhoTookIt) {
  std::string folder = (fs::temp_directory_path() / "anchord_links_XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  RigOptions options;
  options.links_folder = folder;
  const auto scenario = std::make_shared<const Scenario>(demonstration_scenario());
  auto first = Rig::open(scenario, options).value();
  auto second = Rig::open(scenario, options).value();
  first.reset();
  EXPECT_EQ(fs::read_symlink(second->devices().at(0).link), second->devices().at(0).pty);
  second.reset();
  EXPECT_TRUE(fs::is_empty(folder));
  fs::remove_all(folder);
}

TEST(Rig, ReplacesNothingButALinkByItsLink) {
  std::string folder = (fs::temp_directory_path() / "anchord_links_XXXXXX").string();
  ASSERT_NE(mkdtemp(folder.data()), nullptr);
  Scenario scenario = demonstration_scenario();
  scenario.tags[0].link = folder + "/somebodys";
  ASSERT_EQ(::close(::open(scenario.tags[0].link.c_str(), O_CREAT | O_WRONLY | O_CLOEXEC, 0600)), 0);
  EXPECT_EQ(Rig::open(std::make_shared<const Scenario>(scenario), {}).error().code, Errc::conflict);
  EXPECT_TRUE(fs::is_regular_file(scenario.tags[0].link));
  fs::remove_all(folder);
}

TEST(Rig, RefusesAScenarioThatCannotRunAndAPortThatIsTaken) {
  Scenario scenario = demonstration_scenario();
  auto first = Rig::open(std::make_shared<const Scenario>(scenario), {});
  ASSERT_TRUE(first);
  scenario.rovers[0].tcp_port = first.value()->devices().at(1).tcp_port;
  EXPECT_EQ(Rig::open(std::make_shared<const Scenario>(scenario), {}).error().code, Errc::conflict);
  scenario.path.clear();
  EXPECT_EQ(Rig::open(std::make_shared<const Scenario>(scenario), {}).error().code, Errc::invalid_argument);
}

TEST(Rig, DevicesPulledTwoHundredTimesComeBackAndNothingLeaks) {
  Scenario scenario = demonstration_scenario();
  scenario.radio.loss_chance = scenario.radio.zero_chance = 0;
  scenario.tags.clear();
  scenario.rovers.clear();
  for (int i = 0; i < 8; ++i) {
    TagSetup& tag = scenario.tags.emplace_back();
    tag.name = "tag" + std::to_string(i);
    tag.id = NetworkId{0x6e01u + static_cast<unsigned>(i)};
    RoverSetup& rover = scenario.rovers.emplace_back();
    rover.name = "rover" + std::to_string(i);
    rover.port = i % 2 ? RoverPort::pty : RoverPort::tcp;
    rover.format = i % 4 < 2 ? RoverFormat::nmea : RoverFormat::ubx;
    rover.rate_hz = 50;
    rover.delay_s = 0;
  }
  Bench bench(scenario);
  std::map<std::string, int> pulls;
  const auto rows_of = [&](const std::string& name) {
    // Of eight receivers one gives the track; the others are heard.
    const auto dropped = bench.loop->device(name)->dropped;
    const auto other = dropped.find("other_source");
    return bench.rows.fixes[name].size() + bench.rows.ranges[name].size() +
           (other == dropped.end() ? 0 : other->second);
  };
  const auto everybody_speaks = [&] {
    std::map<std::string, std::size_t> before;
    for (const auto& device : bench.rig->devices()) before[device.name] = rows_of(device.name);
    return bench.until([&] {
      for (const auto& [name, n] : before) {
        if (rows_of(name) < n + 3) return false;
      }
      return true;
    });
  };
  ASSERT_TRUE(everybody_speaks());
  const auto descriptors = entries_of("/proc/self/fd"), threads = entries_of("/proc/self/task");
  std::mt19937 random(7);
  const auto pause = [&](int most_ms) {
    const auto until =
        bench.rig->now_s() + 1e-3 * static_cast<double>(random() % static_cast<unsigned>(most_ms));
    ASSERT_TRUE(bench.until([&] { return bench.rig->now_s() >= until; }));
  };
  int pulled = 0;
  for (int round = 0; round < 13; ++round) {  // 13 x 16 pulls
    for (const auto& device : bench.rig->devices()) {
      pause(8);
      ASSERT_TRUE(bench.rig->plug(device.name, false));
      ++pulls[device.name];
      ++pulled;
    }
    for (const auto& device : bench.rig->devices()) {
      pause(8);
      ASSERT_TRUE(bench.rig->plug(device.name, true));
    }
    ASSERT_TRUE(everybody_speaks()) << "round " << round;
  }
  EXPECT_GE(pulled, 200);
  EXPECT_EQ(entries_of("/proc/self/fd"), descriptors);
  EXPECT_EQ(entries_of("/proc/self/task"), threads);
  for (const auto& device : bench.loop->devices()) {
    const std::string& name = device.settings.name;
    EXPECT_EQ(device.dropped.count("driver_fault"), 0u) << name;
    EXPECT_EQ(device.conflict, "") << name;
    // Epochs are missing around the pulls only: as many gaps as pulls at most.
    int gaps = 0;
    const auto& fixes = bench.rows.fixes[name];
    for (std::size_t i = 1; i < fixes.size(); ++i)
      gaps += seconds_between(fixes[i - 1].time, fixes[i].time) > 0.03;
    EXPECT_LE(gaps, pulls[name]) << name;
    for (const Range& range : bench.rows.ranges[name]) EXPECT_LT(range.distance_m, 100) << name;
    // Of the ranges that left the tag by its wire each is a row, but for one on the wire when it was cut.
    // Every other kind of loss would be counted by its reason.
    const auto told = bench.rig->told_ranges(name), stored = bench.rows.ranges[name].size();
    EXPECT_LE(stored, told) << name;
    EXPECT_LE(told - stored, device.lost) << name << ": " << told << " told";
    for (const char* reason : {"stale_range", "zero_distance", "distance_impossible", "rss_impossible"})
      EXPECT_EQ(device.dropped.count(reason), 0u) << name << " " << reason;
  }
}

}  // namespace
}  // namespace anchord::sim::rig_test
