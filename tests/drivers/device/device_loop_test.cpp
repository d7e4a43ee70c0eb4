#include "drivers/device/device_loop.hpp"

#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>

#include "../gnss/samples.hpp"
#include "../link/peer.hpp"
#include "drivers/device/pipeline.hpp"
#include "drivers/record/recorder.hpp"

// The whole of it on real ptys and sockets; the test plays the device and its cable.

namespace anchord::device::device_loop_test {
namespace {

namespace fs = std::filesystem;
using link::test::run_until;

struct Listener final : DeviceListener {
  void fix(const std::string&, const Fix& f) override { fixes.push_back(f); }
  void range(const std::string&, const Range&) override {}
  void changed(const std::string&) override { ++changes; }
  void answer(const std::string&, std::uint64_t id, const Result<std::string>& json) override {
    answers[id] = json ? json.value() : json.error().message;
  }
  std::vector<Fix> fixes;
  std::map<std::uint64_t, std::string> answers;
  int changes{0};
};

LoopOptions quick() {
  LoopOptions options;
  options.presence_poll_ms = 5;
  options.supervisor.first_wait_ns = 2'000'000;
  options.supervisor.longest_wait_ns = 20'000'000;
  return options;
}

/// A port that can be pulled: a link by a stable name to a pty that comes and goes.
struct Cable {
  explicit Cable(std::string at) : path(std::move(at)) {}
  ~Cable() { pull(); }
  void plug() {
    char name[128] = {};
    int slave = -1;
    ASSERT_EQ(::openpty(&device, &slave, name, nullptr, nullptr), 0);
    // Our slave end stays open: a pty whose last slave closes reports a hang-up to the device's side.
    keep = slave;
    fs::remove(path);
    fs::create_symlink(name, path);
  }
  void pull() {
    fs::remove(path);
    if (device >= 0) ::close(device);
    if (keep >= 0) ::close(keep);
    device = keep = -1;
  }
  void say(std::string_view text) const {
    ASSERT_EQ(::write(device, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::string path;
  int device{-1}, keep{-1};
};

std::string epoch(int i) {
  char text[160];
  const int h = i / 3600, m = i / 60 % 60, s = i % 60;
  std::snprintf(text, sizeof text, "GNRMC,%02d%02d%02d.00,A,5101.3687,N,00342.6274,E,0.1,0.0,160624,,,R", h,
                m, s);
  auto out = gnss::test::sentence(text);
  std::snprintf(text, sizeof text,
                "GNGGA,%02d%02d%02d.00,5101.3687,N,00342.6274,E,4,14,0.9,22.5,M,45.0,M,0.8,0000", h, m, s);
  return out + gnss::test::sentence(text);
}

std::string temporary(const char* what) {
  return (fs::temp_directory_path() / (std::string("anchord_") + what + std::to_string(::getpid()))).string();
}

const MissionId k_mission{parse_uuid("0190f1f2-0000-7000-8000-000000000001").value()};

Settings gnss(const std::string& id, const std::string& address, const std::string& options = "{}") {
  return {id, "gnss", "rover " + id, address, options};
}

int threads() {
  int n = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator("/proc/self/task")) ++n;
  return n;
}
int descriptors() {
  int n = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator("/proc/self/fd")) ++n;
  return n;
}

TEST(DeviceLoop, PulledAndPluggedTwoHundredTimesLosesOnlyTheFrameThatWasCut) {
  boost::asio::io_context io;
  Listener listener;
  const auto folder = temporary("loop_rec");
  {
    const auto recorder = record::Recorder::open(folder, SystemClock{}.now()).value();
    DeviceLoop loop(io, recorder.get(), listener, quick());
    Cable cable(temporary("cable"));
    ASSERT_TRUE(loop.add(gnss("r", "serial:" + cable.path)));
    loop.record_into(k_mission);
    std::mt19937_64 random(4);
    int sent = 0, threads_before = 0, descriptors_before = 0;
    for (int round = 0; round < 200; ++round) {
      cable.plug();
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::open; }))
          << loop.device("r")->reason;
      const auto bytes_before = loop.device("r")->bytes_in;
      std::string text;
      const auto epochs = random() % 4;
      for (std::uint64_t i = 0; i < epochs; ++i) text += epoch(++sent);
      const auto next = epoch(++sent);
      const auto whole_gga = next.find("$GNGGA");  // cut before the position is complete
      text += next.substr(0, random() % (whole_gga / 2));
      if (!text.empty()) cable.say(text);
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->bytes_in - bytes_before == text.size(); }));
      cable.pull();
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::lost; }));
      if (round == 20) threads_before = threads(), descriptors_before = descriptors();
      --sent;  // the cut one is not expected
      ASSERT_EQ(listener.fixes.size(), static_cast<std::size_t>(sent)) << "round " << round;
    }
    EXPECT_EQ(threads(), threads_before);
    EXPECT_EQ(descriptors(), descriptors_before);
    EXPECT_EQ(loop.device("r")->lost, 200U);
    EXPECT_EQ(loop.device("r")->opened, 200U);
    EXPECT_GT(sent, 200);
  }
  fs::remove_all(folder);
}

/// A receiver's epoch is whole when the next one begins or the wire is quiet: the newest waits in its driver.
TEST(DeviceLoop, LosesNoEpochWhenADeviceIsRemovedOrTheLoopEnds) {
  for (const bool removed : {true, false}) {
    boost::asio::io_context io;
    Listener listener;
    {
      DeviceLoop loop(io, nullptr, listener, quick());
      Cable cable(temporary("last"));
      cable.plug();
      ASSERT_TRUE(loop.add(gnss("r", "serial:" + cable.path)));
      loop.record_into(k_mission);
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::open; }));
      const std::string text = epoch(1) + epoch(2);
      cable.say(text);
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->bytes_in == text.size(); }));
      if (removed) {
        ASSERT_TRUE(loop.remove("r"));
      }
    }
    EXPECT_EQ(listener.fixes.size(), 2U) << (removed ? "removed" : "the loop ended");
  }
}

TEST(DeviceLoop, WhatItRecordsReplaysToTheSameFixes) {
  const auto folder = temporary("loop_replay");
  Listener listener;
  fs::path recording;
  {
    boost::asio::io_context io;
    const auto recorder = record::Recorder::open(folder, SystemClock{}.now()).value();
    recording = recorder->file();
    DeviceLoop loop(io, recorder.get(), listener, quick());
    ASSERT_TRUE(loop.add(gnss("r", "tcp-listen://:0")));
    loop.record_into(k_mission);
    ASSERT_TRUE(run_until(io, [&] { return loop.port("r") != 0; }));
    link::test::Seen device(link::make_link(
        io, link::parse_address("tcp://127.0.0.1:" + std::to_string(loop.port("r"))).value()));
    ASSERT_TRUE(run_until(io, [&] { return device.opens == 1; }));
    for (int i = 1; i <= 5; ++i) {
      ASSERT_TRUE(device.link->write(epoch(i)));
      const auto wanted = static_cast<std::size_t>(i);
      ASSERT_TRUE(run_until(io, [&] { return listener.fixes.size() == wanted; })) << i;
    }
    EXPECT_EQ(loop.device("r")->phase, Phase::talking);
    EXPECT_EQ(loop.device("r")->rover->fix, FixClass::rtk_fixed);
  }
  struct Sink final : PipelineSink {
    void send(std::uint16_t, std::string_view) override {}
    void fix(std::uint16_t, const Fix& f) override { fixes.push_back(f); }
    void range(std::uint16_t, const Range&) override {}
    void rover(std::uint16_t, const RoverStatus&) override {}
    void identified(std::uint16_t, const Identity&) override {}
    void heard(std::uint16_t) override {}
    void dropped(std::uint16_t, std::string_view, std::uint64_t) override {}
    void answer(std::uint16_t, std::uint64_t, const Result<std::string>&) override {}
    void hang_up(std::uint16_t, std::string_view, std::int64_t) override {}
    std::vector<Fix> fixes;
  } sink;
  Pipeline pipeline(sink);
  std::ifstream in(recording, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  record::EventReader reader(text);
  ASSERT_TRUE(reader.begin());
  while (const auto event = reader.next()) (void)pipeline.take(*event);
  ASSERT_EQ(sink.fixes.size(), listener.fixes.size());
  for (std::size_t i = 0; i < sink.fixes.size(); ++i) {
    EXPECT_EQ(sink.fixes[i].time, listener.fixes[i].time);
    EXPECT_EQ(sink.fixes[i].received, listener.fixes[i].received);
    EXPECT_EQ(sink.fixes[i].mission, k_mission);
  }
  fs::remove_all(folder);
}

TEST(DeviceLoop, TwoDevicesOnOnePortAreReportedAndTheFirstGoesOn) {
  boost::asio::io_context io;
  Listener listener;
  DeviceLoop loop(io, nullptr, listener, quick());
  Cable cable(temporary("shared"));
  cable.plug();
  const auto second_name = temporary("alias");
  fs::remove(second_name);
  fs::create_symlink(fs::read_symlink(cable.path), second_name);
  ASSERT_TRUE(loop.add(gnss("a", "serial:" + cable.path)));
  ASSERT_TRUE(run_until(io, [&] { return loop.device("a")->phase == Phase::open; }));
  ASSERT_TRUE(loop.add(gnss("b", "serial:" + second_name)));
  ASSERT_TRUE(run_until(io, [&] { return !loop.device("b")->conflict.empty(); }));
  EXPECT_NE(loop.device("b")->conflict.find("rover a"), std::string::npos);
  EXPECT_EQ(loop.device("a")->phase, Phase::open);
  EXPECT_GE(loop.device("b")->dropped["port_conflict"], 1U);
  const auto same = loop.add(gnss("c", "serial:" + cable.path));
  ASSERT_FALSE(same);
  EXPECT_EQ(same.error().code, Errc::conflict);
  fs::remove(second_name);
}

TEST(DeviceLoop, TwoMountPointsOfOneCasterAreTwoDevices) {
  boost::asio::io_context io;
  Listener listener;
  DeviceLoop loop(io, nullptr, listener, quick());
  const std::string caster = "tcp://127.0.0.1:1";
  EXPECT_TRUE(loop.add({"near", "ntrip", "near", caster, R"({"mount":"NEAR"})"}));
  EXPECT_TRUE(loop.add({"far", "ntrip", "far", caster, R"({"mount":"FAR"})"}));
  EXPECT_FALSE(loop.add(gnss("rover", caster)));
}

TEST(DeviceLoop, TwoTopicsOfOneBrokerAreTwoDevices) {
  boost::asio::io_context io;
  Listener listener;
  DeviceLoop loop(io, nullptr, listener, quick());
  const std::string broker = "tcp://127.0.0.1:1";
  for (const std::string name : {"hall", "yard"}) {
    EXPECT_TRUE(loop.add({name, "mqtt", name, broker,
                          R"({"mapping":{"topic":")" + name +
                              R"(/+/ranges","tag":{"topic_level":2},"anchor":"/a",)"
                              R"("distance":{"pointer":"/d","unit":"m"}}})"}));
  }
  EXPECT_FALSE(loop.add(gnss("rover", broker)));
}

TEST(DeviceLoop, GarbageIsOpenButNotTalkingAndIsCounted) {
  boost::asio::io_context io;
  Listener listener;
  auto options = quick();
  options.supervisor.silent_after_ns = 50'000'000;
  DeviceLoop loop(io, nullptr, listener, options);
  Cable cable(temporary("garbage"));
  cable.plug();
  ASSERT_TRUE(loop.add(gnss("r", "serial:" + cable.path)));
  ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::open; }));
  cable.say(std::string(300, '\x7f') + "$GNGGA,broken*00\r\n");
  ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::silent; }));
  EXPECT_EQ(loop.device("r")->frames, 0U);
  EXPECT_FALSE(loop.device("r")->dropped.empty());
  // What to do is another thing where bytes come than where none do.
  EXPECT_NE(loop.device("r")->reason.find("115200 baud"), std::string::npos) << loop.device("r")->reason;
}

/// Bytes of the kind in a recording, one after the other.
std::string recorded_bytes(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string text(std::istreambuf_iterator<char>(in), {});
  record::EventReader reader(text);
  EXPECT_TRUE(reader.begin());
  std::string out;
  while (const auto event = reader.next())
    if (event->kind == record::EventKind::bytes) out += event->payload;
  return out;
}

// A receiver at the wrong baud rate, or no receiver: 10 MB/s of it filled the disk until no flight could
// start.
TEST(DeviceLoop, OfNoiseASampleIsRecordedAndEverythingFromTheNextFrameOn) {
  for (const bool flight : {false, true}) {
    const auto folder = temporary("loop_noise");
    fs::path recording;
    {
      boost::asio::io_context io;
      Listener listener;
      const auto recorder = record::Recorder::open(folder, SystemClock{}.now()).value();
      recording = recorder->file();
      auto options = quick();
      options.supervisor.silent_after_ns = 10'000'000;
      options.noise = {.in_a_flight_bytes = 6000, .else_bytes = 2000, .sample_bytes = 1000};
      DeviceLoop loop(io, recorder.get(), listener, options);
      ASSERT_TRUE(loop.add(gnss("r", "tcp-listen://:0")));
      if (flight) loop.record_into(k_mission);
      ASSERT_TRUE(run_until(io, [&] { return loop.port("r") != 0; }));
      link::test::Seen device(link::make_link(
          io, link::parse_address("tcp://127.0.0.1:" + std::to_string(loop.port("r"))).value()));
      ASSERT_TRUE(run_until(io, [&] { return device.opens == 1; }));
      const auto say = [&](const std::string& text) {
        const auto before = loop.device("r")->bytes_in;
        ASSERT_TRUE(device.link->write(text));
        ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->bytes_in == before + text.size(); }));
      };
      for (int i = 0; i < 100; ++i) say(std::string(500, '\x7f'));
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::silent; }));
      EXPECT_NE(loop.device("r")->reason.find("Only a sample of them is recorded."), std::string::npos)
          << loop.device("r")->reason;
      EXPECT_GT(loop.device("r")->dropped["noise_not_recorded_bytes"], 40'000U);
      say(epoch(1));
      say(epoch(2));
      ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::talking; }));
      say(epoch(3));
    }
    const auto kept = recorded_bytes(recording);
    const auto noise = kept.size() - (epoch(1) + epoch(2) + epoch(3)).size();
    EXPECT_EQ(noise, flight ? 7000U : 3000U)
        << "what may be there at first, and the sample of the first minute";
    EXPECT_TRUE(kept.ends_with(epoch(1) + epoch(2) + epoch(3)));
    fs::remove_all(folder);
  }
}

TEST(DeviceLoop, ATagWhoseClockIsNotSetIsSaidToBeThatAndNoBrokenLine) {
  boost::asio::io_context io;
  Listener listener;
  auto options = quick();
  options.supervisor.silent_after_ns = 50'000'000;
  DeviceLoop loop(io, nullptr, listener, options);
  Cable cable(temporary("mapped"));
  cable.plug();
  ASSERT_TRUE(loop.add({"t", "ndjson", "tag", "serial:" + cable.path,
                        R"({"mapping":{"tag":"/tag","anchor":"/a","distance":{"pointer":"/d","unit":"m"},)"
                        R"("time":{"pointer":"/t","unit":"s"}}})"}));
  ASSERT_TRUE(run_until(io, [&] { return loop.device("t")->phase == Phase::open; }));
  cable.say(R"({"tag":"0x6a21","a":"0x6a30","d":5.1,"t":1000})"
            "\n");
  ASSERT_TRUE(run_until(io, [&] { return loop.device("t")->phase == Phase::silent; }));
  EXPECT_EQ(loop.device("t")->reason,
            "messages are received, but none of them can be used, most of them for time_off: correct the "
            "mapping, or what the device sends");
}

TEST(BaseWatch, ABaseThatMovesOrIsAnotherInAFlightIsToldOfUntilTheFlightEnds) {
  const BaseStation first{7, {4'000'000, 300'000, 4'900'000}, {}};
  auto moved = first, other = first;
  moved.ecef_m[0] += 3;
  moved.ecef_m[2] -= 4;
  other.station = 8;
  other.ecef_m[1] += 12'300;
  BaseWatch watch;
  watch.note(first);
  watch.note(moved);
  EXPECT_EQ(watch.trouble(), "") << "before a flight nothing is lost by it";
  watch.flight(true);
  watch.note(moved);
  EXPECT_EQ(watch.trouble(), "");
  watch.note(first);
  const std::string said =
      "base station 7 moved by 5.00 m in this flight: positions before and after differ by as much; give the "
      "base its known position and fly again";
  EXPECT_EQ(watch.trouble(), said);
  watch.note(moved);
  EXPECT_EQ(watch.trouble(), said) << "the rows between stay wrong";
  watch.flight(false);
  EXPECT_EQ(watch.trouble(), "");
  watch.note(first);
  watch.flight(true);
  watch.note(other);
  EXPECT_EQ(watch.trouble(),
            "corrections came from base station 7 at first, then from 8, 12 km away: positions before and "
            "after agree only if both are of one network; if not, fly again");
}

TEST(DeviceIds, ADeviceThatInventsThemIsToldAboutAndTakesNoMemory) {
  SentIds ids;
  Range range;
  for (std::uint16_t i = 0; i < 60; ++i) {
    range.tag = NetworkId{static_cast<std::uint16_t>(1 + i % 3)};
    range.anchor = NetworkId{static_cast<std::uint16_t>(1000 + i)};
    ids.note(range);
  }
  EXPECT_EQ(ids.trouble(), "") << "a large site";
  for (std::uint16_t i = 0; i < 5000; ++i) {
    range.tag = NetworkId{static_cast<std::uint16_t>(1 + i)};
    ids.note(range);
  }
  EXPECT_EQ(
      ids.trouble(),
      "it sends more than 64 tag ids: a flight follows the first of them only, all rows are stored; are tag "
      "and anchor of its mapping right?");
}

TEST(DeviceLoop, AnswersCommandsAndSaysWhenNothingIsConnected) {
  boost::asio::io_context io;
  Listener listener;
  DeviceLoop loop(io, nullptr, listener, quick());
  Cable cable(temporary("command"));
  ASSERT_TRUE(loop.add(gnss("r", "serial:" + cable.path)));
  EXPECT_EQ(loop.command("r", {1, "identify", ""}).error().code, Errc::link_lost);
  EXPECT_EQ(loop.command("x", {1, "identify", ""}).error().code, Errc::not_found);
  cable.plug();
  ASSERT_TRUE(run_until(io, [&] { return loop.device("r")->phase == Phase::open; }));
  ASSERT_TRUE(loop.command("r", {2, "identify", ""}));
  ASSERT_TRUE(run_until(io, [&] { return listener.answers.count(2) == 1; }));
  EXPECT_NE(listener.answers[2].find("identify"), std::string::npos);
  ASSERT_TRUE(loop.remove("r"));
  EXPECT_FALSE(loop.device("r"));
}

}  // namespace
}  // namespace anchord::device::device_loop_test
