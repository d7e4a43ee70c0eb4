#include <grp.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "drivers/link/serial_port.hpp"
#include "peer.hpp"

// Real ptys: the kernel's terminal, the test at the device's end.

namespace anchord::link::serial_test {
namespace {

namespace fs = std::filesystem;
using test::run_until;

struct Pty {
  Pty() {
    char name[128] = {};
    int slave = -1;
    EXPECT_EQ(::openpty(&device, &slave, name, nullptr, nullptr), 0);
    path = name;
    ::close(slave);
  }
  ~Pty() { unplug(); }
  void unplug() {
    if (device >= 0) ::close(device);
    device = -1;
  }
  void say(std::string_view text) const {
    EXPECT_EQ(::write(device, text.data(), text.size()), static_cast<ssize_t>(text.size()));
  }
  std::string receive(std::size_t n) const {
    std::string out(n, '\0');
    out.resize(static_cast<std::size_t>(std::max<ssize_t>(0, ::read(device, out.data(), n))));
    return out;
  }
  int device{-1};
  std::string path;
};

TEST(SerialLink, CarriesEveryByteValueUnchanged) {
  Pty pty;
  boost::asio::io_context io;
  auto seen = test::open(io, "serial:" + pty.path);
  ASSERT_TRUE(run_until(io, [&] { return seen.opens == 1; }));
  std::string every;
  for (int i = 0; i < 256; ++i) every += static_cast<char>(i);
  pty.say(every);
  ASSERT_TRUE(run_until(io, [&] { return seen.text.size() >= 256; }));
  EXPECT_EQ(seen.text, every) << "the line discipline is raw: no CR, XON or ^C handling";
  ASSERT_TRUE(seen.link->write(every));
  ASSERT_TRUE(run_until(io, [&] { return seen.link->counters().bytes_out == 256; }));
  EXPECT_EQ(pty.receive(256), every);
}

TEST(SerialLink, NoticesThePlugBeingPulled) {
  Pty pty;
  boost::asio::io_context io;
  auto seen = test::open(io, "serial:" + pty.path);
  ASSERT_TRUE(run_until(io, [&] { return seen.opens == 1; }));
  pty.say("half a fra");
  ASSERT_TRUE(run_until(io, [&] { return !seen.text.empty(); }));
  pty.unplug();
  ASSERT_TRUE(run_until(io, [&] { return seen.why.has_value(); }));
  EXPECT_EQ(seen.why->code, Errc::link_lost);
  EXPECT_NE(seen.why->message.find("unplugged"), std::string::npos) << seen.why->message;
  EXPECT_EQ(seen.text, "half a fra");
}

TEST(SerialLink, ADeviceThatStopsReadingIsLostAtTheWriteDeadline) {
  Pty pty;
  boost::asio::io_context io;
  LinkOptions options;
  options.write_deadline_ms = 200;
  auto seen = test::open(io, "serial:" + pty.path, options);
  ASSERT_TRUE(run_until(io, [&] { return seen.opens == 1; }));
  while (seen.link->write(std::string(4096, 'x'))) {
  }
  ASSERT_TRUE(run_until(io, [&] { return seen.why.has_value(); }));
  EXPECT_NE(seen.why->message.find("no longer accepts data"), std::string::npos) << seen.why->message;
}

TEST(SerialLink, ABusyPortIsSaidToBeBusy) {
  Pty pty;
  const auto first = open_serial(pty.path, 115200);
  ASSERT_TRUE(first);
  const auto second = open_serial(pty.path, 115200);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, Errc::conflict);
  EXPECT_NE(second.error().message.find("busy: another program"), std::string::npos)
      << second.error().message;
  ::close(first.value());
  const auto third = open_serial(pty.path, 115200);
  ASSERT_TRUE(third) << third.error().message;
  ::close(third.value());
}

TEST(SerialLink, AMissingDeviceAPlainFileAndAnOddRateAreToldApart) {
  boost::asio::io_context io;
  auto seen = test::open(io, "serial:/dev/serial/by-id/usb-nothing-of-that-name");
  EXPECT_FALSE(seen.why) << "never from inside open()";
  ASSERT_TRUE(run_until(io, [&] { return seen.why.has_value(); }));
  EXPECT_EQ(seen.why->code, Errc::not_found);
  EXPECT_NE(seen.why->message.find("plugged in"), std::string::npos);

  EXPECT_EQ(open_serial("/dev/null", 115200).error().code, Errc::invalid_argument);
  Pty pty;
  EXPECT_EQ(open_serial(pty.path, 123457).error().code, Errc::invalid_argument);
}

TEST(SerialLink, APortOfAnotherGroupIsExplainedWithTheCommandThatHelps) {
  if (::geteuid() == 0) {
    // Permission bits do not bind root: the explanation is checked from a child without its rights.
    Pty pty;
    ASSERT_EQ(::chown(pty.path.c_str(), 0, 0), 0);
    ASSERT_EQ(::chmod(pty.path.c_str(), 0660), 0);
    const pid_t child = ::fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      if (::setgroups(0, nullptr) != 0 || ::setgid(65534) != 0 || ::setuid(65534) != 0) ::_exit(2);
      const auto fd = open_serial(pty.path, 115200);
      ::_exit(!fd && fd.error().message.find("usermod -aG root") != std::string::npos ? 0 : 1);
    }
    int status = 0;
    ASSERT_EQ(::waitpid(child, &status, 0), child);
    EXPECT_EQ(WEXITSTATUS(status), 0);
    return;
  }
  GTEST_SKIP() << "needs a file of another group: runs as root only";
}

TEST(SerialPorts, AreListedOnceByTheirStableName) {
  const auto root = fs::temp_directory_path() / ("anchord_ports_" + std::to_string(::getpid()));
  fs::create_directories(root / "dev/by-id");
  for (const char* name : {"ttyACM0", "ttyUSB0", "tty1", "null"}) std::ofstream(root / "dev" / name) << "";
  fs::create_symlink("../ttyACM0", root / "dev/by-id/usb-Pozyx_Labs-if00");
  fs::create_symlink("../ttyACM9", root / "dev/by-id/usb-pulled-if00");
  const auto ports = list_serial_ports((root / "dev/by-id").string(), (root / "dev").string());
  fs::remove_all(root);
  ASSERT_EQ(ports.size(), 2U);
  EXPECT_EQ(ports[0].id, "usb-Pozyx_Labs-if00");
  EXPECT_EQ(fs::path(ports[0].device).filename(), "ttyACM0");
  EXPECT_EQ(fs::path(ports[1].path).filename(), "ttyUSB0");
  EXPECT_TRUE(ports[1].id.empty());
}

TEST(SerialPorts, TwoNamesOfOneDeviceHaveOneNumber) {
  Pty pty, other;
  const auto link = fs::temp_directory_path() / ("anchord_link_" + std::to_string(::getpid()));
  fs::create_symlink(pty.path, link);
  EXPECT_EQ(device_number(link.string()).value(), device_number(pty.path).value());
  EXPECT_NE(device_number(other.path).value(), device_number(pty.path).value());
  fs::remove(link);
}

}  // namespace
}  // namespace anchord::link::serial_test
