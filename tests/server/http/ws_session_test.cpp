#include <gtest/gtest.h>

#include <thread>

#include "tests/server/http/echo_peer.hpp"
#include "tests/server/http/http_fixture.hpp"
#include "tests/server/http/ws_client.hpp"

namespace anchord::test::ws_session_test {
namespace {

using std::chrono::milliseconds;

class WsSession : public ::testing::Test {
 protected:
  explicit WsSession(server::HttpServerOptions options = quick_options()) : server_(std::move(options)) {
    server_.gateway.make_peer = [] { return std::make_unique<EchoPeer>(); };
    server_.start();
  }
  TestServer server_;
};

TEST_F(WsSession, AnswersTheHandshakeOfRfc6455) {
  WsClient client(server_.port, "/ws", "Sec-WebSocket-Protocol: anchord.v1\r\n");
  ASSERT_TRUE(client.open());
  // Section 1.3 of the RFC gives this answer to that key.
  EXPECT_NE(client.handshake.find("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo="), std::string::npos);
  EXPECT_NE(client.handshake.find("Sec-WebSocket-Protocol: anchord.v1"), std::string::npos);
  EXPECT_EQ(client.handshake.find("Beast"), std::string::npos);
}

TEST_F(WsSession, EchoesTextAndBinary) {
  WsClient client(server_.port);
  client.send(1, "h\xc3\xa9llo");
  auto frame = client.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->opcode, 1);
  EXPECT_EQ(frame->payload, "h\xc3\xa9llo");
  client.send(2, std::string("\x00\xff\x80", 3));
  frame = client.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->opcode, 2);
  EXPECT_EQ(frame->payload.size(), 3u);
}

TEST_F(WsSession, JoinsFragmentsWithAPingBetween) {
  WsClient client(server_.port);
  client.send(1, "one ", false);
  client.send(9, "alive?");
  client.send(0, "two ", false);
  client.send(0, "three", true);
  auto frame = client.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->opcode, 10);
  EXPECT_EQ(frame->payload, "alive?");
  frame = client.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->payload, "one two three");
}

TEST_F(WsSession, ClosesWith1007OnInvalidUtf8) {
  for (const char* bad : {"\xc0\xaf", "\xed\xa0\x80", "\xf5\x80\x80\x80", "abc\xff"}) {
    WsClient client(server_.port);
    client.send(1, bad);
    EXPECT_EQ(client.ended_with(), 1007) << bad;
  }
  WsClient split(server_.port);
  split.send(1, "\xe2\x82", false);
  split.send(0, "(", true);
  EXPECT_EQ(split.ended_with(), 1007);
}

TEST_F(WsSession, ClosesWith1002OnProtocolErrors) {
  const auto ends = [&](auto act) {
    WsClient client(server_.port);
    act(client);
    return client.ended_with();
  };
  EXPECT_EQ(ends([](WsClient& c) { c.send(3, "reserved opcode"); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(1, "reserved bit", true, 4); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(1, "not masked", true, 0, false); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(0, "continues nothing"); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(9, "fragmented ping", false); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(9, std::string(126, 'x')); }), 1002);
  EXPECT_EQ(ends([](WsClient& c) { c.send(8, std::string("\x03\xec", 2)); }), 1002);  // 1004 must not be sent
}

TEST_F(WsSession, ClosesWith1007WhenTheLastFragmentIsEmptyAndACharacterIsNotComplete) {
  for (const char* head : {"\xe2\x82", "abc\xf0\x9f\x98", "\xc3"}) {
    WsClient client(server_.port);
    client.send(1, head, false);
    client.send(0, "", true);
    EXPECT_EQ(client.ended_with(), 1007) << head;
  }
  WsClient whole(server_.port);
  whole.send(1, "\xe2\x82\xac", false);
  whole.send(0, "", true);
  const auto frame = whole.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->payload, "\xe2\x82\xac");
}

std::string close_payload(int code, const std::string& reason = {}) {
  return std::string{static_cast<char>(code >> 8), static_cast<char>(code)} + reason;
}

TEST_F(WsSession, AnswersACloseWithItsCode) {
  for (const int code : {1000, 1001, 1003, 1007, 1011, 3000, 4010, 4999}) {
    WsClient client(server_.port);
    client.send(8, close_payload(code, "bye"));
    EXPECT_EQ(client.ended_with(), code);
    EXPECT_TRUE(client.socket.read_to_end());
  }
}

// RFC 6455 section 7.4: codes that nobody may send are a protocol error; 5000 and 65535 came back as they
// were.
TEST_F(WsSession, AnswersACloseCodeThatNobodyMaySendWith1002) {
  for (const int code : {0, 999, 1004, 1005, 1006, 1014, 1015, 1016, 2999, 5000, 5001, 65535}) {
    WsClient client(server_.port);
    client.send(8, close_payload(code));
    EXPECT_EQ(client.ended_with(), 1002) << code;
    EXPECT_TRUE(client.socket.read_to_end()) << code;
  }
}

TEST_F(WsSession, NamesItsVersionToAClientThatSpeaksAnother) {
  RawSocket socket(server_.port);
  socket.send(
      "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
      "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 12\r\n\r\n");
  const auto answer = socket.response();
  EXPECT_EQ(status_of(answer), 426) << answer;
  EXPECT_NE(answer.find("Sec-WebSocket-Version: 13\r\n"), std::string::npos) << answer;
}

TEST_F(WsSession, ClosesWith1001WhenTheServerStops) {
  WsClient client(server_.port);
  client.send(1, "x");
  ASSERT_TRUE(client.frame());
  std::thread stopper([&] { server_.http.stop(milliseconds(3000)); });
  EXPECT_EQ(client.ended_with(), 1001);
  client.send(8, std::string("\x03\xe9", 2));
  stopper.join();
}

TEST_F(WsSession, SurvivesAClientThatVanishes) {
  {
    WsClient client(server_.port);
    client.send(1, std::string(60'000, 'x'));
  }
  WsClient next(server_.port);
  next.send(1, "still here");
  const auto frame = next.frame();
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->payload, "still here");
}

server::HttpServerOptions small_limits() {
  auto options = quick_options();
  options.ws_limits.message_bytes = 1000;
  options.ws_limits.max_fragments = 100;
  options.ws_limits.ping = milliseconds(50);
  options.ws_limits.idle = milliseconds(300);
  options.ws_limits.write_stall = milliseconds(300);
  options.ws_limits.close_time = milliseconds(300);
  return options;
}
class WsLimitsTest : public WsSession {
 protected:
  WsLimitsTest() : WsSession(small_limits()) {}
};

TEST_F(WsLimitsTest, ClosesWith1009WhenAMessageIsTooLarge) {
  WsClient whole(server_.port);
  whole.send(1, std::string(1001, 'x'));
  EXPECT_EQ(whole.ended_with(), 1009);
  WsClient fragments(server_.port);
  fragments.send(1, std::string(600, 'x'), false);
  fragments.send(0, std::string(600, 'x'));
  EXPECT_EQ(fragments.ended_with(), 1009);
}

TEST_F(WsLimitsTest, ClosesWith1009WhenAMessageComesInTooManyFragments) {
  WsClient client(server_.port);
  client.send(1, "x", false);
  for (int i = 0; i < 98; ++i) client.send(0, "x", false);
  client.send(0, "x", true);
  auto frame = client.frame();
  while (frame && frame->opcode == 9) frame = client.frame();  // a slow machine is pinged meanwhile
  ASSERT_TRUE(frame) << "a hundred are allowed";
  EXPECT_EQ(frame->payload, std::string(100, 'x'));
  client.send(1, "x", false);
  for (int i = 0; i < 100; ++i) client.send(0, "x", false);
  EXPECT_EQ(client.ended_with(), 1009);
}

TEST_F(WsLimitsTest, PingsAndDropsAPeerThatDoesNotAnswer) {
  WsClient silent(server_.port);
  const auto ping = silent.frame();
  ASSERT_TRUE(ping);
  EXPECT_EQ(ping->opcode, 9);
  EXPECT_TRUE(silent.socket.read_to_end(milliseconds(5000)));
}

TEST_F(WsLimitsTest, KeepsAPeerThatAnswersPings) {
  WsClient alive(server_.port);
  for (int i = 0; i < 12; ++i) {  // 600 ms, twice the idle limit
    const auto ping = alive.frame();
    ASSERT_TRUE(ping);
    ASSERT_EQ(ping->opcode, 9);
    alive.send(10, ping->payload);
  }
}

/// Offers 1 kB frames without end, as a busy topic would, and counts how many were taken.
class FloodPeer final : public server::WsPeer {
 public:
  explicit FloodPeer(std::atomic<int>& taken) : taken_(taken) {}
  void on_open(std::function<void()>) override {}
  void on_message(std::string_view, bool) override {}
  void on_close() override {}
  server::WsFrame next_frame() override {
    ++taken_;
    return {bytes_, false};
  }
  std::optional<std::pair<std::uint16_t, std::string>> close_request() override { return std::nullopt; }

 private:
  std::atomic<int>& taken_;
  std::shared_ptr<const std::string> bytes_{std::make_shared<const std::string>(1000, 'x')};
};

TEST_F(WsLimitsTest, TakesNoMoreFramesForAClientThatDoesNotRead) {
  std::atomic<int> taken{0};
  server_.gateway.make_peer = [&] { return std::make_unique<FloodPeer>(taken); };
  WsClient slow(server_.port, "/ws", "", 4096);
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (server_.http.websockets() > 0 && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(milliseconds(5));
  }
  EXPECT_EQ(server_.http.websockets(), 0u) << "cut after a write without progress";
  EXPECT_LT(taken.load(), 2000) << "the kernel holds some hundred kB, we hold one frame";
}

}  // namespace
}  // namespace anchord::test::ws_session_test
