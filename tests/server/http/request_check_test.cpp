#include "server/http/request_check.hpp"

#include <gtest/gtest.h>

#include "server/http/request_parser.hpp"

namespace anchord::server::request_check_test {
namespace {

const HostPolicy k_policy{{"localhost", "127.0.0.1", "[::1]"}, {"https://portal.example"}};
const HttpLimits k_limits;

/// The way of a head through scan, parser and judge, as the session goes it.
HeadCheck check(const std::string& raw) {
  const auto seen = scan_head(raw, {}, k_limits);
  if (const auto* refusal = std::get_if<Refusal>(&seen)) return *refusal;
  if (std::get<HeadScan>(seen).head_end == 0) return Refusal{0, "incomplete", ""};
  RequestParser parser(k_limits);
  if (auto refusal = parser.parse_head(raw)) return *refusal;
  return validate_head(parser.head(), k_limits, k_policy);
}

int status(const std::string& raw) {
  const auto judgement = check(raw);
  const auto* refusal = std::get_if<Refusal>(&judgement);
  return refusal == nullptr ? 200 : refusal->status;
}

ValidHead good(const std::string& raw) {
  auto judgement = check(raw);
  if (const auto* refusal = std::get_if<Refusal>(&judgement)) {
    ADD_FAILURE() << refusal->status << " " << refusal->detail;
    return {};
  }
  return std::get<ValidHead>(std::move(judgement));
}

std::string get(const std::string& target, const std::string& headers = "Host: localhost\r\n") {
  return "GET " + target + " HTTP/1.1\r\n" + headers + "\r\n";
}
std::string post(const std::string& headers) {
  return "POST /x HTTP/1.1\r\nHost: localhost\r\n" + headers + "\r\n";
}

TEST(RequestCheck, TakesAnOrdinaryRequest) {
  const auto head =
      good(get("/api/v1/anchors?limit=5&q=a%20b+c", "Host: LOCALHOST:8420\r\nX-A: 1\r\nX-A: 2\r\n"));
  EXPECT_EQ(head.request.path, "/api/v1/anchors");
  EXPECT_EQ(head.request.query.at("limit"), "5");
  EXPECT_EQ(head.request.query.at("q"), "a b c");
  EXPECT_EQ(head.request.header("x-a"), "1, 2");
  EXPECT_EQ(head.host, "localhost:8420");
  EXPECT_TRUE(head.keep_alive);
  EXPECT_EQ(head.framing, Framing::none);
}

TEST(RequestCheck, RefusesAMissingHost) { EXPECT_EQ(status(get("/", "")), 400); }
TEST(RequestCheck, RefusesAMissingHostInHttp10) { EXPECT_EQ(status("GET / HTTP/1.0\r\n\r\n"), 400); }
TEST(RequestCheck, RefusesTwoHosts) {
  EXPECT_EQ(status(get("/", "Host: localhost\r\nHost: localhost\r\n")), 400);
}
TEST(RequestCheck, RefusesAMalformedHost) {
  for (const char* host : {"", "a b", "a/b", "u@localhost", "localhost:", "localhost:x", "[::1", "local,host",
                           "localhost:123456"}) {
    EXPECT_EQ(status(get("/", std::string("Host: ") + host + "\r\n")), 400) << host;
  }
}
TEST(RequestCheck, RefusesAHostThatIsNotOurs) { EXPECT_EQ(status(get("/", "Host: evil.example\r\n")), 400); }
TEST(RequestCheck, TakesIpv6Loopback) { EXPECT_EQ(status(get("/", "Host: [::1]:8420\r\n")), 200); }

TEST(RequestCheck, RoutesAbsoluteFormByPathAndJudgesItsAuthority) {
  const auto head = good(get("http://127.0.0.1:1/a?b=c"));
  EXPECT_EQ(head.request.path, "/a");
  EXPECT_EQ(head.host, "127.0.0.1:1");
  EXPECT_EQ(status(get("http://evil.example/a")), 400);
  EXPECT_EQ(status(get("ftp://localhost/a")), 400);
  EXPECT_EQ(status(get("http:///a")), 400);
  EXPECT_EQ(good(get("http://localhost")).request.path, "/");
}

TEST(RequestCheck, RefusesFoldedContentLength) {
  EXPECT_EQ(status(post("Content-Length:\r\n 5\r\n")), 400);
  EXPECT_EQ(status(post("Content-Length: 1\r\n\t5\r\n")), 400);
}
TEST(RequestCheck, RefusesAnyFoldedLine) {
  EXPECT_EQ(status(get("/", "Host: localhost\r\nX-A: b\r\n c\r\n")), 400);
}
TEST(RequestCheck, RefusesContentLengthThatIsNotOneNumber) {
  for (const char* value : {"5, 5", "+5", "-1", "0x5", "5 5", "", "99999999999999999999", "5,6"}) {
    EXPECT_EQ(status(post(std::string("Content-Length: ") + value + "\r\n")), 400) << value;
  }
}
TEST(RequestCheck, RefusesTwoContentLengths) {
  EXPECT_EQ(status(post("Content-Length: 5\r\nContent-Length: 5\r\n")), 400);
}
TEST(RequestCheck, RefusesContentLengthWithTransferEncoding) {
  EXPECT_EQ(status(post("Transfer-Encoding: chunked\r\nContent-Length: 5\r\n")), 400);
  EXPECT_EQ(status(post("Content-Length: 5\r\nTransfer-Encoding: chunked\r\n")), 400);
}
TEST(RequestCheck, RefusesTransferEncodingOtherThanChunked) {
  for (const char* value :
       {"gzip", "gzip, chunked", "chunked, gzip", "identity", "xchunked", "chunked;q=1", ""}) {
    EXPECT_EQ(status(post(std::string("Transfer-Encoding: ") + value + "\r\n")), 501) << value;
  }
  EXPECT_EQ(good(post("Transfer-Encoding: Chunked\r\n")).framing, Framing::chunked);
}
TEST(RequestCheck, RefusesTransferEncodingInHttp10) {
  EXPECT_EQ(status("POST / HTTP/1.0\r\nHost: localhost\r\nTransfer-Encoding: chunked\r\n\r\n"), 400);
}
TEST(RequestCheck, RefusesCompressedBodies) {
  EXPECT_EQ(status(post("Content-Length: 5\r\nContent-Encoding: gzip\r\n")), 415);
}
TEST(RequestCheck, RefusesRepeatedHeadersThatDecide) {
  for (const char* name :
       {"Authorization", "Content-Type", "Cookie", "Origin", "Expect", "X-Anchord", "Idempotency-Key"}) {
    const std::string line = std::string(name) + ": x\r\n";
    EXPECT_EQ(status(get("/", "Host: localhost\r\n" + line + line)), 400) << name;
  }
}
TEST(RequestCheck, KnowsOnlyOneExpectation) {
  EXPECT_TRUE(good(post("Content-Length: 5\r\nExpect: 100-Continue\r\n")).expects_continue);
  EXPECT_EQ(status(post("Content-Length: 5\r\nExpect: tea\r\n")), 417);
}

TEST(RequestCheck, RefusesBrokenPercentEncoding) {
  for (const char* target :
       {"/%", "/%4", "/%zz", "/a?b=%f", "/a?%zz=1", "/%00", "/a%0d%0a", "/%c3%28", "/a?b=%00", "/%e2%82"}) {
    EXPECT_EQ(status(get(target)), 400) << target;
  }
}
TEST(RequestCheck, RefusesWhatMovesSegments) {
  for (const char* target : {"/a/../b", "/..", "/a/%2e%2e/b", "/a%2fb", "/a%5cb", "/./a"}) {
    EXPECT_EQ(status(get(target)), 400) << target;
  }
}
TEST(RequestCheck, RefusesRepeatedAndNamelessQueryKeys) {
  EXPECT_EQ(status(get("/a?b=1&b=2")), 400);
  EXPECT_EQ(status(get("/a?b=1&%62=2")), 400);
  EXPECT_EQ(status(get("/a?=1")), 400);
  EXPECT_EQ(good(get("/a?b&c=&&d=%26")).request.query.size(), 3u);
}
TEST(RequestCheck, BoundsQueryParameters) {
  std::string target = "/a?";
  for (int i = 0; i < 65; ++i) target += "k" + std::to_string(i) + "=1&";
  EXPECT_EQ(status(get(target)), 400);
}
TEST(RequestCheck, RefusesFragmentsAndRawBytesInTheTarget) {
  EXPECT_EQ(status(get("/a#b")), 400);
  EXPECT_EQ(status(get("/a\x80")), 400);
}
TEST(RequestCheck, RefusesAsteriskForOtherThanOptions) {
  EXPECT_EQ(status(get("*")), 400);
  EXPECT_EQ(status("OPTIONS * HTTP/1.1\r\nHost: localhost\r\n\r\n"), 200);
}
TEST(RequestCheck, RefusesUnknownMethodsAndVersions) {
  EXPECT_EQ(status("BREW / HTTP/1.1\r\nHost: localhost\r\n\r\n"), 501);
  EXPECT_EQ(status("TRACE / HTTP/1.1\r\nHost: localhost\r\n\r\n"), 501);
  EXPECT_EQ(status("CONNECT localhost:1 HTTP/1.1\r\nHost: localhost\r\n\r\n"), 501);
  EXPECT_EQ(status("GET / HTTP/2.0\r\nHost: localhost\r\n\r\n"), 505);
  EXPECT_NE(status("PRI * HTTP/2.0\r\n\r\n"), 200);
}
TEST(RequestCheck, RefusesLooseLineEndsAndControlCharacters) {
  EXPECT_EQ(status("GET / HTTP/1.1\nHost: localhost\n\n"), 400);
  EXPECT_EQ(status("GET / HTTP/1.1\r\nHost: localhost\rX: y\r\n\r\n"), 400);
  EXPECT_EQ(status(get("/",
                       "Host: localhost\r\nX: a\x01"
                       "b\r\n")),
            400);
  EXPECT_EQ(status(get("/", std::string("Host: localhost\r\nX: a") + '\0' + "b\r\n")), 400);
}
TEST(RequestCheck, RefusesSpaceBeforeTheColon) { EXPECT_EQ(status(get("/", "Host : localhost\r\n")), 400); }
TEST(RequestCheck, RefusesWhatIsNotHttpAtTheFirstByte) {
  const auto seen = scan_head("\x16\x03\x01", {}, k_limits);
  ASSERT_TRUE(std::holds_alternative<Refusal>(seen));
  EXPECT_EQ(std::get<Refusal>(seen).status, 400);
}

TEST(RequestCheck, BoundsTheRequestLine) {
  EXPECT_EQ(status(get("/" + std::string(8 * 1024, 'a'))), 414);
  EXPECT_EQ(status(get("/" + std::string(7 * 1024, 'a'))), 200);
}
TEST(RequestCheck, BoundsTheHead) {
  EXPECT_EQ(status(get("/", "Host: localhost\r\nX: " + std::string(16 * 1024, 'a') + "\r\n")), 431);
}
TEST(RequestCheck, BoundsTheNumberOfHeaders) {
  std::string many = "Host: localhost\r\n";
  for (int i = 0; i < 99; ++i) many += "X-" + std::to_string(i) + ": 1\r\n";
  EXPECT_EQ(status(get("/", many)), 200);
  EXPECT_EQ(status(get("/", many + "X-99: 1\r\nX-100: 1\r\n")), 431);
}

TEST(RequestCheck, AsksForACompleteWebSocketHandshake) {
  const std::string base = "Host: localhost\r\nUpgrade: websocket\r\nConnection: keep-alive, Upgrade\r\n";
  const std::string key = "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";
  EXPECT_TRUE(good(get("/", base + key + "Sec-WebSocket-Version: 13\r\n")).websocket);
  EXPECT_EQ(status(get("/", base + key + "Sec-WebSocket-Version: 8\r\n")), 426);
  EXPECT_EQ(status(get("/", base + key)), 426);
  EXPECT_EQ(status(get("/", base + "Sec-WebSocket-Version: 13\r\n")), 400);
  // RFC 6455 section 4.1: 16 bytes in base64. Only the length of the text was looked at.
  for (const char* bad : {"", "x", "!!!!!!!!!!!!!!!!!!!!!!!!", "AAAAAAAAAAAAAAAAAAAAAAAA",
                          "dGhlIHNhbXBsZSBub25jZQ=", "dGhlIHNhbXBsZSBub25jZQ",
                          "dGhlIHNhbXBsZSBub25j====", "dGhlIHNhbXBsZQ=="}) {
    const std::string other = "Sec-WebSocket-Key: " + std::string(bad) + "\r\n";
    EXPECT_EQ(status(get("/", base + other + "Sec-WebSocket-Version: 13\r\n")), 400) << bad;
  }
  EXPECT_FALSE(good(get("/", "Host: localhost\r\nUpgrade: h2c\r\nConnection: Upgrade\r\n")).websocket);
}

TEST(OriginRule, LetsThePagesOwnOriginAndListedOnesIn) {
  EXPECT_TRUE(origin_allowed("", "localhost:8420", k_policy));
  EXPECT_TRUE(origin_allowed("http://localhost:8420", "localhost:8420", k_policy));
  EXPECT_TRUE(origin_allowed("https://portal.example", "localhost:8420", k_policy));
  EXPECT_FALSE(origin_allowed("http://localhost:9999", "localhost:8420", k_policy));
  EXPECT_FALSE(origin_allowed("http://evil.example", "localhost:8420", k_policy));
  EXPECT_FALSE(origin_allowed("null", "localhost:8420", k_policy));
  EXPECT_FALSE(origin_allowed("file://localhost:8420", "localhost:8420", k_policy));
}

// A head cut anywhere is incomplete or refused, never taken for a shorter good one.
TEST(RequestCheck, NeverTakesATruncatedHead) {
  const std::string raw = get("/a?b=c", "Host: localhost\r\nContent-Length: 12\r\n");
  for (std::size_t n = 1; n < raw.size(); ++n) EXPECT_NE(status(raw.substr(0, n)), 200) << n;
}

}  // namespace
}  // namespace anchord::server::request_check_test
