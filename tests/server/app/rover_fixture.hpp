#pragma once

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <nlohmann/json.hpp>
#include <thread>

#include "core/base/time.hpp"
#include "tests/server/app/app_fixture.hpp"

namespace anchord::test {

using Json = nlohmann::json;

inline std::string sentence(const std::string& body) {
  unsigned sum = 0;
  for (const char c : body) sum ^= static_cast<unsigned char>(c);
  char end[8];
  std::snprintf(end, sizeof end, "*%02X\r\n", sum);
  return "$" + body + end;
}

/// A receiver as a TCP server: an epoch of RTK fixed position each 50 ms, of now.
class Receiver {
 public:
  Receiver() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    EXPECT_EQ(::bind(socket_, reinterpret_cast<sockaddr*>(&at), sizeof at), 0);
    EXPECT_EQ(::listen(socket_, 4), 0);
    socklen_t size = sizeof at;
    ::getsockname(socket_, reinterpret_cast<sockaddr*>(&at), &size);
    address_ = "tcp://127.0.0.1:" + std::to_string(ntohs(at.sin_port));
    thread_ = std::thread([this] { serve(); });
  }
  ~Receiver() {
    stop_ = true;
    thread_.join();
    ::close(socket_);
  }
  const std::string& address() const { return address_; }

 private:
  static std::string epoch() {
    const std::string now = to_rfc3339(UtcTime{SystemClock{}.now().ns / 10'000'000 * 10'000'000});
    const std::string time =
        now.substr(11, 2) + now.substr(14, 2) + now.substr(17, 2) + "." + now.substr(20, 2);
    const std::string date = now.substr(8, 2) + now.substr(5, 2) + now.substr(2, 2);
    return sentence("GNRMC," + time + ",A,5101.3687380,N,00342.6274020,E,0.70,109.44," + date + ",,,D") +
           sentence("GNGGA," + time + ",5101.3687380,N,00342.6274020,E,4,14,0.9,22.500,M,45.012,M,0.8,0000") +
           sentence("GNGST," + time + ",0.4,,,,0.012,0.012,0.021");
  }
  void serve() {
    int peer = -1;
    while (!stop_) {
      pollfd waiting{peer < 0 ? socket_ : -1, POLLIN, 0};
      ::poll(&waiting, 1, 50);
      if (peer < 0 && (waiting.revents & POLLIN)) peer = ::accept4(socket_, nullptr, nullptr, SOCK_CLOEXEC);
      const std::string text = epoch();
      if (peer >= 0 && ::send(peer, text.data(), text.size(), MSG_NOSIGNAL) < 0) {
        ::close(peer);
        peer = -1;
      }
    }
    if (peer >= 0) ::close(peer);
  }
  int socket_;
  std::string address_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// A server without sign-in that a test may ask as often as it likes.
struct Rover : AppFixture {
  explicit Rover(Settings more = {}) : AppFixture(with(std::move(more))) {}
  static Settings with(Settings more) {
    more.insert({{"auth", "off"}, {"rate.burst", "100000"}});
    return more;
  }
  Json ask(std::string_view method, const std::string& target, const Json& body = nullptr,
           const std::map<std::string, std::string>& headers = {}) {
    last = call(method, target, body.is_null() ? std::string() : body.dump(), headers);
    return Json::parse(last.body, nullptr, false);
  }
  /// Asks until it is so; the last answer when 20 s pass first.
  Json until(const std::string& target, const std::function<bool(const Json&)>& so) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(20);
    for (;;) {
      Json json = ask("GET", target);
      if (so(json) || std::chrono::steady_clock::now() > end) return json;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }
  server::ClientResponse last;
};

}  // namespace anchord::test
