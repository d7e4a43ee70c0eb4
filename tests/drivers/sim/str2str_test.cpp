// RTKLIB's str2str between simulated devices and our drivers: a relay over TCP, from a serial port and into a
// file, and an NTRIP caster.
#include <gtest/gtest.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>

#include "drivers/device/device_loop.hpp"
#include "drivers/gnss/decoder.hpp"
#include "drivers/sim/ports.hpp"
#include "drivers/sim/rig.hpp"
#include "tests/drivers/sim/program.hpp"
#include "tests/ports.hpp"

namespace anchord::sim::str2str_test {
namespace {

namespace fs = std::filesystem;
constexpr const char* k_str2str = "/usr/bin/str2str";

/// Message 1005 of the RTCM 10403 standard's own example.
const std::string k_1005(
    "\xd3\x00\x13\x3e\xd7\xd3\x02\x02\x98\x0e\xde\xef\x34\xb4\xbd\x62\xac\x09\x41\x98\x6f\x33\x36\x0b\x98",
    25);

struct RowsByTime final : device::DeviceListener {
  void fix(const std::string& id, const Fix& row) override { fixes[id][row.time.ns] = row; }
  void range(const std::string&, const Range&) override {}
  void changed(const std::string&) override {}
  void answer(const std::string&, std::uint64_t, const Result<std::string>&) override {}
  std::map<std::string, std::map<std::int64_t, Fix>> fixes;  ///< by time
};

class Str2str : public testing::Test {
 protected:
  void SetUp() override {
    if (::access(k_str2str, X_OK) != 0) GTEST_SKIP() << "SKIP: str2str (package rtklib) is not installed";
    std::string pattern = (fs::temp_directory_path() / "anchord_str2str_XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
    loop_.record_into(MissionId{Uuid{{1}}});
  }
  void TearDown() override {
    std::error_code ignored;
    if (!folder_.empty()) fs::remove_all(folder_, ignored);
  }
  void serve(RoverFormat format, RoverPort port) {
    Scenario scenario = demonstration_scenario();
    scenario.tags.clear();
    scenario.rovers[0].format = format;
    scenario.rovers[0].port = port;
    auto rig = Rig::open(std::make_shared<const Scenario>(scenario), {});
    ASSERT_TRUE(rig) << rig.error().message;
    rig_ = std::move(rig).value();
  }
  ServedDevice rover() const { return rig_->devices().at(0); }
  /// A device that waits for str2str; where.
  std::string listen() {
    EXPECT_TRUE(loop_.add({"relayed", "gnss", "relayed", "tcp-listen://127.0.0.1:0", "{}"}));
    EXPECT_TRUE(until([&] { return loop_.port("relayed") != 0; }));
    return "tcpcli://127.0.0.1:" + std::to_string(loop_.port("relayed"));
  }
  bool until(
      const std::function<bool()>& so, const std::function<void()>& also = [] {}) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (!so()) {
      if (std::chrono::steady_clock::now() > end) return false;
      io_.restart();
      io_.poll();
      also();
      if (rig_) {
        rig_->step(2);
      } else {
        io_.run_for(std::chrono::milliseconds(2));
      }
    }
    return true;
  }
  fs::path folder_;
  boost::asio::io_context io_{1};
  RowsByTime rows_;
  std::unique_ptr<Rig> rig_;
  device::DeviceLoop loop_{io_, nullptr, rows_, {}};
};

TEST_F(Str2str, RelaysARoverOverTcpAndIntoAFileWithoutMovingIt) {
  serve(RoverFormat::ubx, RoverPort::tcp);
  const std::string log = folder_ / "rover.ubx";
  device::DeviceLoop beside{io_, nullptr, rows_, {}};  // one loop has one track
  beside.record_into(MissionId{Uuid{{1}}});
  ASSERT_TRUE(beside.add({"direct", "gnss", "direct", rover().address, "{}"}));
  test::Program relay({k_str2str, "-in", "tcpcli://127.0.0.1:" + std::to_string(rover().tcp_port), "-out",
                       listen(), "-out", "file://" + log, "-r", "200"});
  ASSERT_TRUE(until([&] { return rows_.fixes["relayed"].size() >= 20; })) << loop_.device("relayed")->reason;
  relay.end(SIGINT);
  EXPECT_EQ(loop_.device("relayed")->identity.model, "GNSS receiver (ubx)");
  const auto& direct = rows_.fixes["direct"];
  int same = 0;
  for (const auto& [time_ns, fix] : rows_.fixes["relayed"]) {
    const auto found = direct.find(time_ns);
    if (found == direct.end()) continue;  // the first one may have come before our own connection
    ++same;
    // NAV-PVT's own digits: where a relay pauses inside an epoch, HPPOSLLH and COV may come too late for it.
    EXPECT_NEAR(fix.position.lat_deg, found->second.position.lat_deg, 1.1e-7);
    EXPECT_NEAR(fix.position.lon_deg, found->second.position.lon_deg, 1.1e-7);
    EXPECT_NEAR(fix.position.height_m, found->second.position.height_m, 1.1e-3);
    EXPECT_EQ(fix.fix, found->second.fix);
  }
  EXPECT_GE(same, 18);

  std::ifstream in(log, std::ios::binary);
  const std::string bytes(std::istreambuf_iterator<char>(in), {});
  gnss::Decoder decoder;
  gnss::Epochs epochs;
  decoder.feed(bytes, epochs);
  decoder.finish(epochs);
  EXPECT_GE(epochs.size(), rows_.fixes["relayed"].size());
}

TEST_F(Str2str, RelaysARoverFromASerialPort) {
  serve(RoverFormat::nmea, RoverPort::pty);
  const std::string port = rover().pty.substr(std::string("/dev/").size());
  test::Program relay(
      {k_str2str, "-in", "serial://" + port + ":115200:8:n:1:off", "-out", listen(), "-r", "200"});
  ASSERT_TRUE(until([&] { return rows_.fixes["relayed"].size() >= 10; })) << loop_.device("relayed")->reason;
  EXPECT_EQ(rows_.fixes["relayed"].rbegin()->second.fix, FixClass::rtk_fixed);
}

TEST_F(Str2str, AsACasterGivesCorrectionsThatReachTheRoverWhole) {
  const auto base = make_tcp(0), receiver = make_tcp(0);
  ASSERT_TRUE(base->up());
  ASSERT_TRUE(receiver->up());
  const std::string password = folder_ / "password";
  std::ofstream(password) << "secret\n";
  const std::string caster = std::to_string(anchord::test::free_tcp_port());
  test::Program casting({k_str2str, "-in", "tcpcli://127.0.0.1:" + std::to_string(base->port()), "-out",
                         "ntripc://me:secret@:" + caster + "/BASE", "-r", "200"});
  ASSERT_TRUE(loop_.add({"rover", "gnss", "rover", "tcp://127.0.0.1:" + std::to_string(receiver->port()),
                         R"({"corrections":"ntrip"})"}));
  ASSERT_TRUE(loop_.add({"caster", "ntrip", "caster", "tcp://127.0.0.1:" + caster,
                         R"({"mount":"BASE","user":"me","version":1,"password_file":")" + password + "\"}"}));
  std::string heard;
  const auto turn = [&] {
    (void)base->arrived();
    (void)base->receive();
    (void)receiver->arrived();
    base->send_all(k_1005);
    for (const auto& part : receiver->receive()) heard += part.bytes;
  };
  EXPECT_TRUE(until([&] { return heard.size() >= 40 * k_1005.size(); }, turn))
      << loop_.device("caster")->reason;
  EXPECT_EQ(loop_.device("caster")->phase, device::Phase::talking);
  // Cut anywhere, but whole and in order.
  const auto first = heard.find(k_1005);
  ASSERT_NE(first, std::string::npos);
  for (auto at = first; at + k_1005.size() <= heard.size(); at += k_1005.size())
    ASSERT_EQ(heard.compare(at, k_1005.size(), k_1005), 0) << at;

  std::ofstream(password) << "guess\n";
  ASSERT_TRUE(loop_.remove("caster"));
  ASSERT_TRUE(loop_.add({"guesser", "ntrip", "guesser", "tcp://127.0.0.1:" + caster,
                         R"({"mount":"BASE","user":"me","version":1,"password_file":")" + password + "\"}"}));
  EXPECT_TRUE(
      until([&] { return loop_.device("guesser")->reason.find("password") != std::string::npos; }, turn))
      << loop_.device("guesser")->reason;
}

}  // namespace
}  // namespace anchord::sim::str2str_test
