// What a webhook's receiver, a stranger, may do to who sends to it.
#include "server/http/web_post.hpp"

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <string>
#include <thread>

namespace anchord::server::web_post_test {
namespace {

/// Takes one connection, reads the request, and sends `head`, then `again` for as long as anybody takes it.
class RogueReceiver {
 public:
  RogueReceiver(std::string head, std::string again) {
    listening_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    EXPECT_EQ(::bind(listening_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(::listen(listening_, 1), 0);
    ::getsockname(listening_, reinterpret_cast<sockaddr*>(&address), &size);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this, head = std::move(head), again = std::move(again)] { answer(head, again); });
  }
  ~RogueReceiver() {
    // What it has sent and nobody reads would keep it for a minute.
    ::shutdown(peer_, SHUT_RDWR);
    thread_.join();
    ::close(peer_);
    ::close(listening_);
  }
  RogueReceiver(const RogueReceiver&) = delete;
  RogueReceiver& operator=(const RogueReceiver&) = delete;

  std::string url() const { return "http://127.0.0.1:" + std::to_string(port_) + "/hook"; }
  std::uint64_t taken() const { return taken_; }

 private:
  void answer(const std::string& head, const std::string& again) {
    peer_ = ::accept(listening_, nullptr, nullptr);
    char request[4096];
    (void)::recv(peer_, request, sizeof request, 0);
    for (const std::string* text = &head;; text = &again) {
      const ssize_t n = ::send(peer_, text->data(), text->size(), MSG_NOSIGNAL);
      if (n <= 0) break;
      taken_ += static_cast<std::uint64_t>(n);
    }
  }
  int listening_{-1};
  std::atomic<int> peer_{-1};
  std::uint16_t port_{};
  std::atomic<std::uint64_t> taken_{0};
  std::thread thread_;
};

WebPost::Message to(const RogueReceiver& receiver) {
  WebPost::Message message;
  message.method = "POST";
  message.url = receiver.url();
  message.body = "{}";
  return message;
}

TEST(WebPost, AHeadThatNeverEndsIsCutOffBeforeItFillsTheMemory) {
  RogueReceiver receiver("HTTP/1.1 200 OK\r\n", "X-More: " + std::string(7000, 'x') + "\r\n");
  const auto post = make_web_post(true);
  const auto answer = post->send(to(receiver));
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().code, Errc::link_lost);
  EXPECT_NE(answer.error().message.find("MiB that are no answer"), std::string::npos)
      << answer.error().message;
  EXPECT_LT(receiver.taken(), 100u << 20);
}

TEST(WebPost, SaysInWordsThatNobodyListens) {
  const int bound = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);  // and nobody listens
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ASSERT_EQ(::bind(bound, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  ::getsockname(bound, reinterpret_cast<sockaddr*>(&address), &size);
  WebPost::Message message;
  message.method = "POST";
  message.url = "http://127.0.0.1:" + std::to_string(ntohs(address.sin_port)) + "/hook?token=abcdef";
  const auto answer = make_web_post(true)->send(message);
  ::close(bound);
  ASSERT_FALSE(answer);
  EXPECT_EQ(answer.error().message,
            "no answer from 127.0.0.1 (127.0.0.1): no connection: refused, or no way there");
}

TEST(WebPost, ABodyThatNeverEndsIsCutOffAndTheStatusCounts) {
  RogueReceiver receiver("HTTP/1.1 204 No Content\r\nX-A: b\r\nContent-Length: 99999999999\r\n\r\n",
                         std::string(8192, 'y'));
  const auto post = make_web_post(true);
  const auto answer = post->send(to(receiver));
  ASSERT_TRUE(answer) << answer.error().message;
  EXPECT_EQ(answer.value().status, 204);
}

}  // namespace
}  // namespace anchord::server::web_post_test
