#include <gtest/gtest.h>

#include <thread>

#include "tests/server/http/http_fixture.hpp"

namespace anchord::test::http_session_test {
namespace {

using std::chrono::milliseconds;
using SteadyClock = std::chrono::steady_clock;

const std::string k_get = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";

std::string post(std::string_view path, std::string_view body, std::string_view more = "") {
  return "POST " + std::string(path) +
         " HTTP/1.1\r\nHost: localhost\r\nContent-Length: " + std::to_string(body.size()) + "\r\n" +
         std::string(more) + "\r\n" + std::string(body);
}
std::string chunked(std::string_view path, std::string_view chunks) {
  return "POST " + std::string(path) + " HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n" +
         std::string(chunks);
}

class HttpSession : public ::testing::Test {
 protected:
  HttpSession() { server_.start(); }
  /// Sends, expects this status, and that the server ends the connection without reading on.
  void expect_refusal(std::string_view bytes, int status) {
    RawSocket socket(server_.port);
    // What follows would be a valid request: it must not be answered.
    socket.send(std::string(bytes));
    socket.send(k_get);
    EXPECT_TRUE(socket.read_to_end()) << bytes.substr(0, 80);
    EXPECT_EQ(status_of(socket.input), status) << bytes.substr(0, 80);
    EXPECT_NE(socket.input.find("Connection: close"), std::string::npos);
    EXPECT_EQ(socket.input.find("hello"), std::string::npos) << "read on after a framing error";
  }
  TestServer server_;
};

TEST_F(HttpSession, KeepsTheConnectionAlive) {
  RawSocket socket(server_.port);
  for (int i = 0; i < 3; ++i) {
    socket.send(k_get);
    EXPECT_EQ(body_of(socket.response()), "hello");
  }
}

/// A problem says when to come again, and whoever makes it may know better; clients join what comes twice.
TEST_F(HttpSession, SendsAFieldThatIsNoListOnceWithItsLastValue) {
  server_.gateway.handler = [](api::Request&) {
    auto response = api::problem(429, "rate-limited", "wait");
    response.header("Set-Cookie", "a=1").header("retry-after", "7").header("Set-Cookie", "b=2");
    return response;
  };
  RawSocket socket(server_.port);
  socket.send(k_get);
  const std::string head = socket.response();
  EXPECT_EQ(head.find("Retry-After: 1\r\n"), std::string::npos) << head;
  EXPECT_NE(head.find("retry-after: 7\r\n"), std::string::npos) << head;
  EXPECT_NE(head.find("Set-Cookie: a=1\r\n"), std::string::npos) << head;
  EXPECT_NE(head.find("Set-Cookie: b=2\r\n"), std::string::npos) << head;
}

TEST_F(HttpSession, AnswersPipelinedRequestsInOrder) {
  RawSocket socket(server_.port);
  socket.send(post("/echo", "one") + k_get + chunked("/echo", "3\r\ntwo\r\n0\r\n\r\n") +
              post("/sum", "1234"));
  EXPECT_EQ(body_of(socket.response()), "one");
  EXPECT_EQ(body_of(socket.response()), "hello");
  EXPECT_EQ(body_of(socket.response()), "two");
  EXPECT_EQ(body_of(socket.response()), "4");
}

TEST_F(HttpSession, ServesARequestThatComesByteByByte) {
  RawSocket socket(server_.port);
  for (const char c : chunked("/echo", "3;a=b\r\none\r\n2\r\n22\r\n0\r\nTrailer: x\r\n\r\n"))
    socket.send({&c, 1});
  EXPECT_EQ(body_of(socket.response()), "one22");
}

TEST_F(HttpSession, ForgivesAnEmptyLineBeforeTheRequest) {
  RawSocket socket(server_.port);
  socket.send("\r\n" + k_get);
  EXPECT_EQ(status_of(socket.response()), 200);
}

TEST_F(HttpSession, ClosesWhenAskedTo) {
  RawSocket socket(server_.port);
  socket.send("GET / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_EQ(status_of(socket.input), 200);
}

TEST_F(HttpSession, ClosesAfterHttp10UnlessAskedToKeep) {
  RawSocket socket(server_.port);
  socket.send("GET / HTTP/1.0\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_EQ(status_of(socket.input), 200);
  RawSocket kept(server_.port);
  kept.send("GET / HTTP/1.0\r\nHost: localhost\r\nConnection: keep-alive\r\n\r\n");
  EXPECT_NE(kept.response().find("Connection: keep-alive"), std::string::npos);
}

TEST_F(HttpSession, AnswersAHalfClosedClient) {
  RawSocket socket(server_.port);
  socket.send(post("/echo", "last words"));
  socket.half_close();
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_EQ(body_of(socket.input), "last words");
}

TEST_F(HttpSession, EndsQuietlyWhenTheBodyIsCutOff) {
  RawSocket socket(server_.port);
  socket.send("POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length: 10\r\n\r\nabc");
  socket.half_close();
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_EQ(socket.input, "");
}

TEST_F(HttpSession, HeadGivesTheHeadersOfGetWithoutItsBody) {
  RawSocket socket(server_.port);
  socket.send("HEAD / HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n");
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_NE(socket.input.find("Content-Length: 5\r\n"), std::string::npos);
  EXPECT_TRUE(socket.input.ends_with("\r\n\r\n"));
}

TEST_F(HttpSession, CarriesSecurityHeadersAndNoBanner) {
  RawSocket socket(server_.port);
  socket.send("GET / HTTP/1.1\r\nHost: localhost\r\nX-Request-Id: abc-1\r\n\r\n");
  const std::string response = socket.response();
  for (const char* header :
       {"X-Content-Type-Options: nosniff", "Referrer-Policy: no-referrer", "default-src 'none'",
        "frame-ancestors 'none'", "Cache-Control: no-store", "X-Request-Id: abc-1"}) {
    EXPECT_NE(response.find(header), std::string::npos) << header;
  }
  EXPECT_EQ(response.find("Server:"), std::string::npos);
  socket.send("GET / HTTP/1.1\r\nHost: localhost\r\nX-Request-Id: a\"b{}\r\n\r\n");
  EXPECT_EQ(socket.response().find("a\"b"), std::string::npos) << "a forged id is replaced";
}

TEST_F(HttpSession, RefusesEachTrapAndCloses) {
  expect_refusal("GET / HTTP/1.1\r\n\r\n", 400);
  expect_refusal("GET / HTTP/1.1\r\nHost: localhost\r\nHost: localhost\r\n\r\n", 400);
  expect_refusal("GET / HTTP/1.1\r\nHost: a b\r\n\r\n", 400);
  expect_refusal("GET http://evil.example/ HTTP/1.1\r\nHost: localhost\r\n\r\n", 400);
  expect_refusal("POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length:\r\n 5\r\n\r\n", 400);
  expect_refusal("POST /echo HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: gzip, chunked\r\n\r\n", 501);
  expect_refusal("POST /echo HTTP/1.1\r\nHost: localhost\r\nTransfer-Encoding: xchunked\r\n\r\n", 501);
  expect_refusal(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length: 5\r\nTransfer-Encoding: chunked\r\n\r\n",
      400);
  expect_refusal(
      "POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Encoding: gzip\r\nContent-Length: 1\r\n\r\nx", 415);
  expect_refusal("GET / HTTP/1.1\nHost: localhost\n\n", 400);
  expect_refusal("\x16\x03\x01\x02", 400);
}

TEST_F(HttpSession, RefusesBrokenChunksAndCloses) {
  expect_refusal(chunked("/echo", "zz\r\nabc\r\n0\r\n\r\n"), 400);
  expect_refusal(chunked("/echo", "3\r\nabcd\r\n0\r\n\r\n"), 400);
  expect_refusal(chunked("/echo", "-3\r\nabc\r\n0\r\n\r\n"), 400);
  expect_refusal(chunked("/echo", "ffffffffffffffffff\r\n"), 400);
}

TEST_F(HttpSession, CountsChunkExtensions) {
  std::string chunks;
  for (int i = 0; i < 30; ++i) chunks += "1;x=" + std::string(40, 'e') + "\r\na\r\n";
  expect_refusal(chunked("/echo", chunks + "0\r\n\r\n"), 400);
  expect_refusal(chunked("/echo", "1;x=" + std::string(20'000, 'e')), 400);
}

TEST_F(HttpSession, RefusesWhatIsTooLargeBeforeReadingIt) {
  expect_refusal("GET /" + std::string(9000, 'a') + " HTTP/1.1\r\nHost: localhost\r\n\r\n", 414);
  expect_refusal("GET / HTTP/1.1\r\nHost: localhost\r\nX: " + std::string(17'000, 'a') + "\r\n\r\n", 431);
  std::string many = "GET / HTTP/1.1\r\nHost: localhost\r\n";
  for (int i = 0; i < 101; ++i) many += "X-" + std::to_string(i) + ": 1\r\n";
  expect_refusal(many + "\r\n", 431);
  expect_refusal("POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length: 100001\r\n\r\n", 413);
  expect_refusal(chunked("/echo", "186a1\r\n" + std::string(100'001, 'a') + "\r\n0\r\n\r\n"), 413);
}

TEST_F(HttpSession, AnswersExpectContinue) {
  RawSocket socket(server_.port);
  socket.send("POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\nExpect: 100-continue\r\n\r\n");
  ASSERT_TRUE(
      socket.read_until([](const std::string& all) { return all.find("\r\n\r\n") != std::string::npos; }));
  EXPECT_EQ(socket.input, "HTTP/1.1 100 Continue\r\n\r\n");
  socket.input.clear();
  socket.send("abc");
  EXPECT_EQ(body_of(socket.response()), "abc");
}

TEST_F(HttpSession, RefusesInsteadOfContinue) {
  RawSocket socket(server_.port);
  socket.send(
      "POST /denied HTTP/1.1\r\nHost: localhost\r\nContent-Length: 3\r\nExpect: 100-continue\r\n\r\n");
  EXPECT_EQ(status_of(socket.response()), 401);
  EXPECT_TRUE(socket.read_to_end());
}

TEST_F(HttpSession, KeepsTheConnectionAfterRefusingASmallBody) {
  RawSocket socket(server_.port);
  socket.send(post("/denied", "abc") + k_get);
  EXPECT_EQ(status_of(socket.response()), 401);
  EXPECT_EQ(body_of(socket.response()), "hello");
}

TEST_F(HttpSession, StreamsAnUploadLargerThanThePipe) {
  RawSocket socket(server_.port);
  std::thread sender([&] { socket.send(post("/sum", std::string(3'000'000, 'x'))); });
  EXPECT_EQ(body_of(socket.response()), "3000000");
  sender.join();
  socket.send(chunked("/sum", "5\r\n12345\r\n0\r\n\r\n"));
  EXPECT_EQ(body_of(socket.response()), "5");
}

TEST_F(HttpSession, AnswersAHandlerThatDoesNotReadItsUpload) {
  RawSocket socket(server_.port);
  std::thread sender([&] { socket.send(post("/early", std::string(3'000'000, 'x'))); });
  EXPECT_EQ(status_of(socket.response()), 507);
  EXPECT_TRUE(socket.read_to_end());
  sender.join();
}

TEST_F(HttpSession, StreamsAnAnswerInChunks) {
  RawSocket socket(server_.port);
  socket.send("GET /stream HTTP/1.1\r\nHost: localhost\r\n\r\n");
  ASSERT_TRUE(socket.read_until([](const std::string& all) { return all.ends_with("0\r\n\r\n"); }));
  EXPECT_EQ(body_of(socket.input), "6\r\npiece0\r\n6\r\npiece1\r\n6\r\npiece2\r\n0\r\n\r\n");
  socket.input.clear();
  socket.send(k_get);
  EXPECT_EQ(body_of(socket.response()), "hello");
}

TEST_F(HttpSession, StreamsToHttp10UntilTheEnd) {
  RawSocket socket(server_.port);
  socket.send("GET /stream HTTP/1.0\r\nHost: localhost\r\n\r\n");
  EXPECT_TRUE(socket.read_to_end());
  EXPECT_EQ(body_of(socket.input), "piece0piece1piece2");
}

TEST_F(HttpSession, CompressesLargeTextWhenAccepted) {
  RawSocket socket(server_.port);
  socket.send("GET /large HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: br;q=0.9, gzip\r\n\r\n");
  const std::string response = socket.response();
  EXPECT_NE(response.find("Content-Encoding: gzip"), std::string::npos);
  EXPECT_LT(response.size(), 100'000u);
  socket.send("GET / HTTP/1.1\r\nHost: localhost\r\nAccept-Encoding: gzip\r\n\r\n");
  EXPECT_EQ(socket.response().find("Content-Encoding"), std::string::npos) << "not worth it below 1 kB";
}

TEST_F(HttpSession, SurvivesAHandlerThatThrows) {
  RawSocket socket(server_.port);
  socket.send("GET /throw HTTP/1.1\r\nHost: localhost\r\n\r\n" + k_get);
  EXPECT_EQ(status_of(socket.response()), 500);
  EXPECT_EQ(body_of(socket.response()), "hello");
}

TEST_F(HttpSession, SaysOverloadedWhenThePoolIsFull) {
  std::vector<std::unique_ptr<RawSocket>> sockets;
  const auto hold = [&] {
    sockets.push_back(std::make_unique<RawSocket>(server_.port));
    sockets.back()->send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  };
  hold();
  hold();
  server_.gateway.wait_for_held(2);    // both workers
  for (int i = 0; i < 5; ++i) hold();  // four wait, the fifth is refused
  std::string refused;
  for (auto& socket : sockets) {
    if (socket->read_until([](const std::string& all) { return !all.empty(); }, milliseconds(100)))
      refused = socket->input;
  }
  EXPECT_EQ(status_of(refused), 503);
  EXPECT_NE(refused.find("Retry-After: 1"), std::string::npos);
  server_.gateway.release();
}

TEST(HttpTimes, CutsSlowHeaders) {
  auto options = quick_options();
  options.limits.head_time = milliseconds(200);
  TestServer server(options);
  server.start();
  RawSocket socket(server.port);
  const auto begin = SteadyClock::now();
  // A loris: every piece comes in time, the whole does not.
  for (const char c : std::string("GET / HTTP/1.1\r\nHost: localhost\r\n") + std::string(1000, 'X')) {
    if (!socket.send({&c, 1})) break;
    socket.read_until([](const std::string&) { return false; }, milliseconds(15));
    if (socket.closed) break;
  }
  EXPECT_TRUE(socket.closed);
  EXPECT_LT(SteadyClock::now() - begin, milliseconds(3000));
}

TEST(HttpTimes, CutsAClientThatSaysNothing) {
  auto options = quick_options();
  options.limits.head_time = milliseconds(100);
  TestServer server(options);
  server.start();
  RawSocket socket(server.port);
  EXPECT_TRUE(socket.read_to_end(milliseconds(3000)));
}

TEST(HttpTimes, CutsIdleConnectionsAfterKeepAlive) {
  auto options = quick_options();
  options.limits.keep_alive = milliseconds(100);
  TestServer server(options);
  server.start();
  RawSocket socket(server.port);
  socket.send(k_get);
  EXPECT_EQ(status_of(socket.response()), 200);
  EXPECT_TRUE(socket.read_to_end(milliseconds(3000)));
}

TEST(HttpTimes, CutsABodyBelowTheFloor) {
  auto options = quick_options();
  options.limits.body_window = milliseconds(200);
  TestServer server(options);
  server.start();
  for (const char* path : {"/echo", "/sum"}) {
    RawSocket socket(server.port);
    socket.send("POST " + std::string(path) +
                " HTTP/1.1\r\nHost: localhost\r\nContent-Length: 90000\r\n\r\n");
    const auto begin = SteadyClock::now();
    while (!socket.closed && SteadyClock::now() - begin < milliseconds(5000)) {
      socket.send("x");  // about 50 bytes a second
      socket.read_until([](const std::string&) { return false; }, milliseconds(20));
    }
    EXPECT_TRUE(socket.closed) << path;
  }
}

TEST(HttpTimes, LetsASteadyBodyTakeLongerThanTheWindow) {
  auto options = quick_options();
  options.limits.body_window = milliseconds(150);
  TestServer server(options);
  server.start();
  RawSocket socket(server.port);
  socket.send("POST /echo HTTP/1.1\r\nHost: localhost\r\nContent-Length: 20000\r\n\r\n");
  for (int i = 0; i < 20; ++i) {
    socket.send(std::string(1000, 'x'));  // 20 ms each: 50 kB/s for 400 ms
    socket.read_until([](const std::string&) { return false; }, milliseconds(20));
  }
  EXPECT_EQ(body_of(socket.response()).size(), 20'000u);
}

TEST(HttpTimes, CutsAReaderThatDoesNotRead) {
  auto options = quick_options();
  options.limits.write_stall = milliseconds(200);
  TestServer server(options);
  server.start();
  RawSocket socket(server.port, 4096);
  socket.send("GET /large HTTP/1.1\r\nHost: localhost\r\n\r\n");
  const auto end = SteadyClock::now() + milliseconds(10'000);
  while (server.http.connections() == 0 && SteadyClock::now() < end) std::this_thread::yield();
  while (server.http.connections() > 0 && SteadyClock::now() < end)
    std::this_thread::sleep_for(milliseconds(5));
  EXPECT_EQ(server.http.connections(), 0u);
}

TEST(HttpLimitsTest, RefusesConnectionsWhenAllAreAtWorkAndRecovers) {
  auto options = quick_options();
  options.limits.max_connections = 2;
  TestServer server(options);
  server.start();
  RawSocket first(server.port), second(server.port);
  first.send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  second.send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  server.gateway.wait_for_held(2);
  RawSocket third(server.port);
  EXPECT_TRUE(third.read_to_end());
  EXPECT_EQ(status_of(third.input), 503);
  EXPECT_NE(third.input.find("all 2 connections are in use"), std::string::npos) << third.input;
  EXPECT_NE(third.input.find("Retry-After: 5"), std::string::npos);
  server.gateway.release();
  EXPECT_EQ(status_of(first.response()), 200);
  RawSocket again(server.port);
  again.send(k_get);
  EXPECT_EQ(status_of(again.response()), 200);
}

// Idle sockets took every place until their time-out, 75 s later.
TEST(HttpLimitsTest, GivesThePlaceOfTheOldestIdleConnectionToWhoComes) {
  auto options = quick_options();
  options.limits.max_connections = 3;
  TestServer server(options);
  server.start();
  RawSocket oldest(server.port), second(server.port), third(server.port);
  for (auto* socket : {&oldest, &second, &third}) {
    socket->send(k_get);
    EXPECT_EQ(status_of(socket->response()), 200);
  }
  RawSocket fourth(server.port);
  fourth.send(k_get);
  EXPECT_EQ(status_of(fourth.response()), 200);
  EXPECT_TRUE(oldest.read_to_end());
  second.send(k_get);
  EXPECT_EQ(status_of(second.response()), 200) << "only one had to go";
  // One that dribbles a head waits for a request as well.
  RawSocket slow(server.port);
  slow.send("GET / HT");
  for (int i = 0; i < 10; ++i) {
    RawSocket next(server.port);
    next.send(k_get);
    EXPECT_EQ(status_of(next.response()), 200) << i;
  }
}

TEST(HttpLimitsTest, BoundsTheConnectionsOfOneAddressApart) {
  auto options = quick_options();
  options.limits.max_connections = 10;
  options.limits.max_per_address = 2;
  TestServer server(options, 4);
  server.start();
  RawSocket first(server.port), second(server.port);
  first.send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  second.send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  server.gateway.wait_for_held(2);
  RawSocket third(server.port);
  EXPECT_TRUE(third.read_to_end());
  EXPECT_NE(third.input.find("all 2 connections of one address"), std::string::npos) << third.input;
}

// `land` took 86 s beside the plan checks of one viewer: all requests waited in one line.
TEST(Executors, AnswerACommandWhileComputationsHoldTheirsAndItsQueue) {
  TestServer server;
  server.start();
  std::vector<std::unique_ptr<RawSocket>> computing;
  const auto compute = [&](const std::string& token) {
    computing.push_back(std::make_unique<RawSocket>(server.port));
    computing.back()->send("GET /heavy HTTP/1.1\r\nHost: localhost\r\nX-Token: " + token + "\r\n\r\n");
  };
  compute("t0");
  compute("t1");
  server.gateway.wait_for_held(2);  // both threads have one, so the next two wait
  compute("t2");
  compute("t3");
  while (server.heavy.queued() < 2) std::this_thread::yield();
  RawSocket command(server.port);
  for (int i = 0; i < 100; ++i) {
    command.send("GET /command HTTP/1.1\r\nHost: localhost\r\n\r\n");
    ASSERT_EQ(body_of(command.response()), "held position") << i;
  }
  EXPECT_EQ(server.gateway.held, 2) << "not one computation has ended meanwhile";
  RawSocket ordinary(server.port);
  ordinary.send(k_get);
  EXPECT_EQ(status_of(ordinary.response()), 200) << "nor do they hold up what is ordinary";
  compute("late");
  EXPECT_EQ(status_of(computing.back()->response()), 503) << "the queue is full: said at once";
  server.gateway.release();
  for (std::size_t i = 0; i < 4; ++i) EXPECT_EQ(body_of(computing[i]->response()), "computed");
}

TEST(Executors, GiveOneTokenOnlyItsShareOfComputations) {
  auto options = quick_options();
  options.limits.heavy_per_token = 2;
  TestServer server(options);
  server.start();
  const std::string ask = "GET /heavy HTTP/1.1\r\nHost: localhost\r\nX-Token: ";
  RawSocket first(server.port), second(server.port), third(server.port), other(server.port);
  first.send(ask + "a\r\n\r\n");
  second.send(ask + "a\r\n\r\n");
  server.gateway.wait_for_held(2);
  third.send(ask + "a\r\n\r\n");
  const auto refused = third.response();
  EXPECT_EQ(status_of(refused), 429) << refused;
  EXPECT_NE(refused.find("Retry-After: 1"), std::string::npos);
  other.send(ask + "b\r\n\r\n");
  while (server.heavy.queued() < 1) std::this_thread::yield();
  server.gateway.release();
  EXPECT_EQ(status_of(first.response()), 200);
  EXPECT_EQ(status_of(other.response()), 200);
  EXPECT_EQ(status_of(second.response()), 200);
  third.send(ask + "a\r\n\r\n");
  EXPECT_EQ(status_of(third.response()), 200) << "its share came back";
}

TEST(HttpStop, FinishesWhatRunsAndEndsIdleConnections) {
  TestServer server;
  server.start();
  RawSocket idle(server.port), busy(server.port);
  idle.send(k_get);
  EXPECT_EQ(status_of(idle.response()), 200);
  busy.send("GET /hold HTTP/1.1\r\nHost: localhost\r\n\r\n");
  server.gateway.wait_for_held(1);
  std::thread stopper([&] { server.http.stop(milliseconds(5000)); });
  EXPECT_TRUE(idle.read_to_end());
  server.gateway.release();
  EXPECT_TRUE(busy.read_to_end());
  EXPECT_EQ(status_of(busy.input), 200);
  EXPECT_NE(busy.input.find("Connection: close"), std::string::npos);
  stopper.join();
  EXPECT_FALSE(RawSocket(server.port).connected());
}

TEST(Listening, TellsLoopbackFromTheRest) {
  EXPECT_TRUE(server::is_loopback("127.0.0.1:1").value());
  EXPECT_TRUE(server::is_loopback("[::1]:1").value());
  EXPECT_TRUE(server::is_loopback("localhost:1").value());
  EXPECT_FALSE(server::is_loopback("0.0.0.0:1").value());
  EXPECT_FALSE(server::is_loopback("[::]:1").value());
  EXPECT_FALSE(server::is_loopback("192.168.1.2:1").value());
  for (const char* bad : {"", "x", "127.0.0.1", "127.0.0.1:", "127.0.0.1:99999", "example.org:80"}) {
    EXPECT_FALSE(server::is_loopback(bad)) << bad;
  }
}

}  // namespace
}  // namespace anchord::test::http_session_test
