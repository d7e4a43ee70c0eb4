// The aircraft behind a TCP port and behind a serial line (a pty), as an autopilot or a telemetry radio shows
// itself: the link that the server flies by, a real socket, the simulated autopilot at the other end. UDP is
// what the flights of tests/e2e fly by.
#include "server/flight/drone_link.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <mutex>
#include <span>
#include <thread>
#include <vector>

#include "drivers/sim/autopilot.hpp"
#include "drivers/sim/ports.hpp"
#include "tests/ports.hpp"

namespace anchord::flight::drone_link_test {
namespace {

using Clock = std::chrono::steady_clock;
constexpr double k_hurry = 4;  // the aircraft's seconds in one of ours

/// The autopilot at its port, on a thread of its own.
class Aircraft {
 public:
  explicit Aircraft(std::unique_ptr<sim::Port> port) : port_(std::move(port)), autopilot_(options()) {
    EXPECT_TRUE(port_->up());
    thread_ = std::thread([this] { run(); });
  }
  ~Aircraft() {
    over_ = true;
    thread_.join();
  }
  std::uint16_t port() {
    const std::scoped_lock lock(mutex_);
    return port_->port();
  }
  void plug(bool in) {
    const std::scoped_lock lock(mutex_);
    if (in)
      EXPECT_TRUE(port_->up());
    else
      port_->down();
  }
  std::size_t n_fence() {
    const std::scoped_lock lock(mutex_);
    return autopilot_.fence_list().size();
  }

 private:
  static sim::AutopilotOptions options() {
    sim::AutopilotOptions out;
    out.ready_s = 1;
    out.link_loss_s = 1e9;  // its failsafe is another test's
    return out;
  }
  void run() {
    const auto begun = Clock::now();
    while (!over_) {
      {
        const std::scoped_lock lock(mutex_);
        autopilot_.advance(k_hurry * std::chrono::duration<double>(Clock::now() - begun).count());
        const auto out = autopilot_.take_bytes();
        if (port_->is_up()) {
          (void)port_->arrived();
          for (const auto& heard : port_->receive())
            autopilot_.feed({reinterpret_cast<const std::uint8_t*>(heard.bytes.data()), heard.bytes.size()});
          port_->send_all({reinterpret_cast<const char*>(out.data()), out.size()});
        }
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));  // the pace of the aircraft, not a wait
    }
  }

  std::mutex mutex_;
  std::unique_ptr<sim::Port> port_;
  sim::AutopilotSim autopilot_;
  std::atomic<bool> over_{false};
  std::thread thread_;
};

template <class Done>
bool until(Done done, double seconds) {
  for (const auto end = Clock::now() + std::chrono::duration<double>(seconds); Clock::now() < end;) {
    if (done()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return done();
}

/// The last word on a command.
CommandReport fate(DroneLink& link, std::uint64_t number) {
  CommandReport last;
  EXPECT_TRUE(until(
      [&] {
        for (const auto& r : link.take_reports()) {
          if (r.number == number && r.state != CommandState::sent) last = r;
        }
        return last.number == number;
      },
      60))
      << "no word on command " << number;
  return last;
}

void fly(const std::string& address, Aircraft& aircraft) {
  auto opened = DroneLink::open(address, {});
  ASSERT_TRUE(opened) << opened.error().message;
  auto& link = *opened.value();
  link.start();
  ASSERT_TRUE(
      until([&] { return link.status().connected && link.status().position && link.status().home; }, 30))
      << address;
  EXPECT_EQ(link.status().autopilot, "ArduPilot");
  const auto accepted = [&](std::uint64_t number) {
    const auto report = fate(link, number);
    EXPECT_EQ(report.state, CommandState::accepted) << address << ' ' << report.what << ": " << report.text;
  };
  accepted(link.upload_fence({{{3.712, 51.022}, {3.715, 51.022}, {3.715, 51.025}, {3.712, 51.025}}, {}}));
  EXPECT_EQ(aircraft.n_fence(), 4u);
  link.new_flight(2);
  accepted(link.take_off(3));
  ASSERT_TRUE(until([&] { return link.status().relative_m.value_or(0) > 2.7; }, 30));
  const auto home = *link.status().home;
  accepted(link.go_to(home.lat_deg + 5e-5, home.lon_deg, 4, 90));
  accepted(link.hold());
  EXPECT_TRUE(until([&] { return link.status().mode == "BRAKE"; }, 10));
  // The plug is pulled: said within seconds; put back: flown again without anybody's help.
  aircraft.plug(false);
  EXPECT_TRUE(until([&] { return !link.status().connected; }, 20));
  aircraft.plug(true);
  EXPECT_TRUE(until([&] { return link.status().connected; }, 20));
  accepted(link.land());
  EXPECT_TRUE(until([&] { return !link.status().armed; }, 30));
}

/// An autopilot that says who it is from a UDP socket of its own.
class Sender {
 public:
  explicit Sender(std::uint16_t to, std::uint8_t system, int type = SOCK_DGRAM)
      : socket_(::socket(AF_INET, type | SOCK_CLOEXEC, 0)), packer_({system, 1}) {
    to_.sin_family = AF_INET;
    to_.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to_.sin_port = htons(to);
    EXPECT_EQ(::connect(socket_, reinterpret_cast<const sockaddr*>(&to_), sizeof to_),
              0);  // it has a port now
    EXPECT_EQ(::fcntl(socket_, F_SETFL, O_NONBLOCK), 0);
  }
  ~Sender() { ::close(socket_); }
  /// As the server sees it, once something was sent.
  std::string address() {
    sockaddr_in own{};
    socklen_t size = sizeof own;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&own), &size);
    return "127.0.0.1:" + std::to_string(ntohs(own.sin_port));
  }
  void beat() {
    const auto frame =
        packer_.pack(mavlink::Message("HEARTBEAT").set("type", 2).set("autopilot", 3).set("custom_mode", 4));
    (void)::send(socket_, frame.data(), frame.size(), MSG_NOSIGNAL);
  }
  /// Datagrams of the server that came here.
  std::size_t heard() {
    std::array<std::uint8_t, 65'536> buffer{};
    for (ssize_t n = 0; (n = ::recv(socket_, buffer.data(), buffer.size(), 0)) > 0; ++n_)
      number_frames({buffer.data(), static_cast<std::size_t>(n)});
    return n_;
  }
  /// Frames so far, and those of them that came after one with a higher number.
  std::size_t frames() const { return frames_; }
  std::size_t overtaken() const { return overtaken_; }

 private:
  /// MAVLink 2: 0xFD, length of the payload, flags (1: a signature of 13 bytes follows), flags, number.
  void number_frames(std::span<const std::uint8_t> bytes) {
    while (bytes.size() >= 12 && bytes[0] == 0xFD) {
      const std::size_t size = 12u + bytes[1] + ((bytes[2] & 1) != 0 ? 13u : 0u);
      if (frames_++ > 0 && static_cast<std::uint8_t>(bytes[4] - number_) > 127) ++overtaken_;
      number_ = bytes[4];
      bytes = bytes.subspan(std::min(size, bytes.size()));
    }
  }

  int socket_;
  sockaddr_in to_{};
  mavlink::Packer packer_;
  std::size_t n_{0}, frames_{0}, overtaken_{0};
  std::uint8_t number_{0};
};

std::uint16_t free_udp_port() {
  const int probe = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  EXPECT_EQ(::bind(probe, reinterpret_cast<sockaddr*>(&at), size), 0);
  ::getsockname(probe, reinterpret_cast<sockaddr*>(&at), &size);
  ::close(probe);
  return ntohs(at.sin_port);
}

bool somebody_listens_at(std::uint16_t port) {
  const int probe = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  at.sin_port = htons(port);
  const bool taken = ::connect(probe, reinterpret_cast<const sockaddr*>(&at), sizeof at) == 0;
  ::close(probe);
  return taken;
}

TEST(DroneLink, ADatagramOfAStrangerTakesNothingOverUdp) {
  const auto port = free_udp_port();
  auto opened = DroneLink::open("udp://:" + std::to_string(port), {});
  ASSERT_TRUE(opened) << opened.error().message;
  auto& link = *opened.value();
  link.start();
  Sender aircraft(port, 1), stranger(port, 1);
  ASSERT_TRUE(until([&] { return aircraft.beat(), link.status().connected && aircraft.heard() > 0; }, 10));
  const auto peer = link.status().identity.peer;
  EXPECT_FALSE(peer.empty());
  ASSERT_TRUE(until([&] { return stranger.beat(), !link.status().others.empty(); }, 10));
  EXPECT_EQ(link.status().others.front().kind, "autopilot");
  const auto before = aircraft.heard();
  (void)link.land();
  ASSERT_TRUE(until([&] { return aircraft.heard() > before; }, 10)) << "the command goes to the aircraft";
  EXPECT_EQ(stranger.heard(), 0u);
  EXPECT_EQ(link.status().identity.peer, peer);
  link.change_peer(link.status().others.front().sender);
  ASSERT_TRUE(until([&] { return stranger.beat(), stranger.heard() > 0; }, 10)) << "a person changed it";
}

/// The newest connection took the link, and with it the aircraft in the air.
TEST(DroneLink, AStrangerWhoConnectsToItsTcpPortTakesNothingAndTheAircraftMayComeBackAtOnce) {
  const auto port = test::free_tcp_port();
  auto opened = DroneLink::open("tcp-listen://127.0.0.1:" + std::to_string(port), {});
  ASSERT_TRUE(opened) << opened.error().message;
  auto& link = *opened.value();
  link.start();
  const auto is_peer = [&](Sender& one) {
    return until([&] { return one.beat(), link.status().identity.peer == one.address(); }, 5);
  };
  ASSERT_TRUE(until([&] { return somebody_listens_at(port); }, 5));
  auto aircraft = std::make_unique<Sender>(port, 1, SOCK_STREAM);
  ASSERT_TRUE(is_peer(*aircraft));
  {
    Sender stranger(port, 1, SOCK_STREAM);
    ASSERT_TRUE(until([&] { return stranger.beat(), !link.status().others.empty(); }, 5));
    const auto before = aircraft->heard();
    (void)link.land();
    ASSERT_TRUE(until([&] { return aircraft->heard() > before; }, 5)) << "the command goes to the aircraft";
    EXPECT_EQ(stranger.heard(), 0u);
    EXPECT_EQ(link.status().identity.peer, aircraft->address());
  }
  aircraft.reset();
  Sender again(port, 1, SOCK_STREAM);
  EXPECT_TRUE(is_peer(again)) << "its connection was closed: nobody waits for ten seconds of silence";
}

TEST(DroneLink, AStrangerWhoIsHeardFirstDoesNotTakeAFlightThatGoesOn) {
  const auto port = free_udp_port();
  Sender aircraft(port, 1), stranger(port, 66);
  auto opened = DroneLink::open("udp://:" + std::to_string(port), {});
  ASSERT_TRUE(opened) << opened.error().message;
  auto& link = *opened.value();
  link.expect({aircraft.address(), 1, 1});
  link.start();
  ASSERT_TRUE(until([&] { return stranger.beat(), !link.status().others.empty(); }, 10));
  EXPECT_FALSE(link.status().connected);
  ASSERT_TRUE(until([&] { return aircraft.beat(), link.status().connected && aircraft.heard() > 0; }, 10));
  EXPECT_EQ(link.status().identity.system, 1);
  EXPECT_EQ(stranger.heard(), 0u);
}

// An autopilot that wants signed frames ignores one that is older than the one before: a command of one
// thread that another's frame overtakes on its way out is lost, and comes only when it is repeated.
TEST(DroneLink, FramesLeaveInTheOrderOfTheirNumbersWhoeverCommands) {
  constexpr int k_threads = 3, k_rounds = 20, k_commands = 200;
  const auto port = free_udp_port();
  auto opened = DroneLink::open("udp://:" + std::to_string(port), {});
  ASSERT_TRUE(opened) << opened.error().message;
  auto& link = *opened.value();
  link.start();
  Sender aircraft(port, 1);
  ASSERT_TRUE(until([&] { return aircraft.beat(), link.status().connected && aircraft.heard() > 0; }, 10));
  for (int round = 0; round < k_rounds; ++round) {
    aircraft.beat();
    std::atomic<int> at_work{k_threads};
    std::vector<std::thread> people;
    for (int i = 0; i < k_threads; ++i) {
      people.emplace_back([&] {
        for (int n = 0; n < k_commands; ++n) (void)link.land();
        --at_work;
      });
    }
    while (at_work > 0) (void)aircraft.heard();
    for (auto& one : people) one.join();
    (void)link.take_reports();
    const auto before = aircraft.heard();
    (void)link.hold();
    ASSERT_TRUE(until([&] { return aircraft.heard() > before; }, 10));
  }
  EXPECT_GT(aircraft.frames(), static_cast<std::size_t>(k_rounds * k_commands));
  EXPECT_EQ(aircraft.overtaken(), 0u) << "of " << aircraft.frames();
}

TEST(DroneLink, FliesTheAircraftOverTcpAndComesBackAfterALoss) {
  Aircraft aircraft(sim::make_tcp(0));
  fly("tcp://127.0.0.1:" + std::to_string(aircraft.port()), aircraft);
}

TEST(DroneLink, FliesTheAircraftOverASerialLineAndComesBackAfterALoss) {
  const auto folder =
      std::filesystem::temp_directory_path() / ("anchord-drone-" + std::to_string(::getpid()));
  std::filesystem::create_directory(folder);
  {
    const std::string line = (folder / "telemetry").string();
    Aircraft aircraft(sim::make_pty(line));
    fly("serial:" + line + "?baud=57600", aircraft);
  }
  std::filesystem::remove_all(folder);
}

}  // namespace
}  // namespace anchord::flight::drone_link_test
