// A real gpsd between the simulated rover and our driver: what it makes of a Reach's NMEA, and what we make
// of that.
#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>

#include "drivers/device/device_loop.hpp"
#include "drivers/sim/rig.hpp"

namespace anchord::sim {
namespace {

constexpr const char* k_gpsd = "/usr/sbin/gpsd";

/// A port that was free a moment ago: gpsd takes a number, not a socket.
int free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  ::bind(fd, reinterpret_cast<sockaddr*>(&at), size);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&at), &size);
  ::close(fd);
  return ntohs(at.sin_port);
}

/// Read-only (-b), without waiting for a client (-n), in the foreground (-N), on loopback.
struct Gpsd {
  Gpsd(const std::string& source, int port) : pid(::fork()) {
    if (pid != 0) return;
    if (::freopen("/dev/null", "w", stderr) == nullptr) ::_exit(126);
    const std::string number = std::to_string(port);
    ::execl(k_gpsd, "gpsd", "-N", "-n", "-b", "-S", number.c_str(), source.c_str(), nullptr);
    ::_exit(127);
  }
  ~Gpsd() {
    ::kill(pid, SIGTERM);
    ::waitpid(pid, nullptr, 0);
  }
  pid_t pid;
};

struct Rows final : device::DeviceListener {
  void fix(const std::string&, const Fix& row) override { fixes.push_back(row); }
  void range(const std::string&, const Range&) override {}
  void changed(const std::string&) override {}
  void answer(const std::string&, std::uint64_t, const Result<std::string>&) override {}
  std::vector<Fix> fixes;
};

TEST(RealGpsd, BetweenTheSimulatedRoverAndOurDriverKeepsPositionFixClassAndHeight) {
  if (::access(k_gpsd, X_OK) != 0) GTEST_SKIP() << "SKIP: gpsd is not installed";
  Scenario scenario = demonstration_scenario();
  scenario.tags.clear();
  scenario.path = {PathPoint{{10, -20, 5}}};
  scenario.rovers[0].rate_hz = 5;
  auto rig = Rig::open(std::make_shared<const Scenario>(scenario), {});
  ASSERT_TRUE(rig) << rig.error().message;
  const int port = free_port();
  Gpsd gpsd("tcp://127.0.0.1:" + std::to_string(rig.value()->devices().at(0).tcp_port), port);
  boost::asio::io_context io{1};
  Rows rows;
  device::DeviceLoop loop(io, nullptr, rows, {});
  loop.record_into(MissionId{Uuid{{1}}});
  ASSERT_TRUE(loop.add({"g", "gnss", "g", "tcp://127.0.0.1:" + std::to_string(port), "{}"}));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  while (rows.fixes.size() < 10 && std::chrono::steady_clock::now() < end) {
    io.restart();
    io.poll();
    rig.value()->step(5);
  }
  ASSERT_GE(rows.fixes.size(), 10u) << loop.device("g")->reason;
  EXPECT_EQ(loop.device("g")->identity.model, "GNSS receiver (gpsd)");
  const Fix& fix = rows.fixes.back();
  EXPECT_EQ(fix.fix, FixClass::rtk_fixed);
  // Five metres above the origin; 20 m south of it, by the degree's length.
  EXPECT_NEAR(fix.position.height_m - scenario.world.origin.height_m, 5, 0.15);
  EXPECT_NEAR((fix.position.lat_deg - scenario.world.origin.lat_deg) * 111'200, -20, 0.2);
  ASSERT_TRUE(fix.covariance_m2);
  EXPECT_LT((*fix.covariance_m2)(2, 2), 0.04 * 0.04) << "GST's sigma, not gpsd's own eph";
}

}  // namespace
}  // namespace anchord::sim
