// A real gpsd between the simulated rover and our driver: what it makes of a Reach's NMEA, and what we make
// of that.
#include <gtest/gtest.h>
#include <unistd.h>

#include <boost/asio/io_context.hpp>
#include <chrono>

#include "drivers/device/device_loop.hpp"
#include "drivers/sim/rig.hpp"
#include "tests/drivers/sim/program.hpp"
#include "tests/ports.hpp"

namespace anchord::sim::gpsd_test {
namespace {

constexpr const char* k_gpsd = "/usr/sbin/gpsd";

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
  const int port = anchord::test::free_tcp_port();
  // Read-only (-b), without waiting for a client (-n), in the foreground (-N), on loopback.
  test::Program gpsd({k_gpsd, "-N", "-n", "-b", "-S", std::to_string(port),
                      "tcp://127.0.0.1:" + std::to_string(rig.value()->devices().at(0).tcp_port)});
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
}  // namespace anchord::sim::gpsd_test
