#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>

#include <memory>

#include "core/base/time.hpp"
#include "server/http/proxy_header.hpp"
#include "tests/server/http/echo_peer.hpp"
#include "tests/server/http/http_fixture.hpp"
#include "tests/server/tls/certificate_folder.hpp"

namespace anchord::tls_session_test {
namespace {

using namespace test;
using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::HasSubstr;

/// A client of OpenSSL's own on a connection of ours: trusts one authority, blocks, and ends after 10 s at
/// most.
class TlsClient {
 public:
  TlsClient(std::uint16_t port, const std::filesystem::path& ca, int newest = TLS1_3_VERSION) : socket(port) {
    context_.reset(SSL_CTX_new(TLS_client_method()));
    SSL_CTX_load_verify_locations(context_.get(), ca.c_str(), nullptr);
    SSL_CTX_set_verify(context_.get(), SSL_VERIFY_PEER, nullptr);
    SSL_CTX_set_min_proto_version(context_.get(), TLS1_VERSION);
    SSL_CTX_set_max_proto_version(context_.get(), newest);
    SSL_CTX_set_security_level(context_.get(), 0);  // old versions may be offered
    const timeval limit{10, 0};
    ::setsockopt(socket.fd(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    ssl_.reset(SSL_new(context_.get()));
    SSL_set_fd(ssl_.get(), socket.fd());
    SSL_set1_host(ssl_.get(), "localhost");
    open = SSL_connect(ssl_.get()) == 1;
  }
  bool send(const std::string& bytes) {
    return SSL_write(ssl_.get(), bytes.data(), static_cast<int>(bytes.size())) ==
           static_cast<int>(bytes.size());
  }
  /// Until `end` is in what came, or the connection ends.
  std::string read_until(const std::string& end) {
    std::string all;
    char piece[16384];
    while (all.find(end) == std::string::npos) {
      const int n = SSL_read(ssl_.get(), piece, sizeof piece);
      if (n <= 0) break;
      all.append(piece, static_cast<std::size_t>(n));
    }
    return all;
  }
  /// The server said that its answer is whole (close_notify), and did not just end the connection.
  bool told_the_end() { return (SSL_get_shutdown(ssl_.get()) & SSL_RECEIVED_SHUTDOWN) != 0; }
  std::string version() const { return SSL_get_version(ssl_.get()); }
  std::string peer_serial() const {
    const std::unique_ptr<X509, decltype(&X509_free)> peer(SSL_get1_peer_certificate(ssl_.get()), X509_free);
    const auto* number = X509_get0_serialNumber(peer.get());
    return {reinterpret_cast<const char*>(ASN1_STRING_get0_data(number)),
            static_cast<std::size_t>(ASN1_STRING_length(number))};
  }

  RawSocket socket;
  bool open{false};

 private:
  std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> context_{nullptr, SSL_CTX_free};
  std::unique_ptr<SSL, decltype(&SSL_free)> ssl_{nullptr, SSL_free};
};

struct TlsServer {
  explicit TlsServer(server::HttpServerOptions options = quick_options())
      : keeper(server::TlsKeeper::open(folder.files()).value()), server([&] {
          options.tls = keeper;
          return std::move(options);
        }()) {
    port = server.http.listen("127.0.0.1:0", true).value();
    server.http.start();
  }
  CertificateFolder folder{"hangar.local"};
  std::shared_ptr<server::TlsKeeper> keeper;
  TestServer server;
  std::uint16_t port{0};
};

const std::string k_get = "GET / HTTP/1.1\r\nHost: localhost\r\n\r\n";

TEST(TlsSession, ServesByBothVersionsAndNoOlderOne) {
  TlsServer server;
  for (const auto& [version, name] :
       {std::pair{TLS1_2_VERSION, "TLSv1.2"}, std::pair{TLS1_3_VERSION, "TLSv1.3"}}) {
    TlsClient client(server.port, server.folder.ca(), version);
    ASSERT_TRUE(client.open) << name;
    EXPECT_EQ(client.version(), name);
    ASSERT_TRUE(client.send(k_get));
    EXPECT_THAT(client.read_until("hello"), HasSubstr("HTTP/1.1 200 OK"));
    ASSERT_TRUE(client.send(k_get));  // kept alive
    EXPECT_THAT(client.read_until("hello"), HasSubstr("HTTP/1.1 200 OK"));
  }
  EXPECT_FALSE(TlsClient(server.port, server.folder.ca(), TLS1_1_VERSION).open);
}

TEST(TlsSession, CarriesLargeBodiesBothWays) {
  TlsServer server;
  TlsClient client(server.port, server.folder.ca());
  ASSERT_TRUE(client.open);
  const std::string body(3'000'000, 'b');
  ASSERT_TRUE(client.send("POST /sum HTTP/1.1\r\nHost: localhost\r\nContent-Length: " +
                          std::to_string(body.size()) + "\r\n\r\n" + body));
  EXPECT_THAT(client.read_until("3000000"), HasSubstr("200 OK"));
  ASSERT_TRUE(client.send("GET /large HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n"));
  const auto all = client.read_until("no such text");
  EXPECT_EQ(all.size() - all.find("\r\n\r\n") - 4, 8'000'000u);
  EXPECT_TRUE(client.told_the_end());
}

TEST(TlsSession, TellsHandlersThatItIsSecureAndBelievesNobodyElse) {
  const auto scheme = [](api::Request& r) {
    return ProbeGateway::text("<" + std::string(r.header("x-forwarded-proto")) + ">");
  };
  const std::string claim = "GET / HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-Proto: https\r\n\r\n";
  const std::string denial = "GET / HTTP/1.1\r\nHost: localhost\r\nX-Forwarded-Proto: http\r\n\r\n";
  TlsServer secure;
  secure.server.gateway.handler = scheme;
  TlsClient client(secure.port, secure.folder.ca());
  ASSERT_TRUE(client.send(k_get));
  EXPECT_THAT(client.read_until(">"), HasSubstr("<https>"));
  ASSERT_TRUE(client.send(denial));
  EXPECT_THAT(client.read_until(">"), HasSubstr("<https>"));

  TestServer plain;
  plain.gateway.handler = scheme;
  plain.start();
  RawSocket stranger(plain.port);
  stranger.send(claim);
  EXPECT_EQ(body_of(stranger.response()), "<>");

  auto options = quick_options();
  options.is_proxy = [](std::string_view address) { return address == "127.0.0.1"; };
  TestServer behind(options);
  behind.gateway.handler = scheme;
  behind.start();
  RawSocket proxy(behind.port);
  proxy.send(claim);
  EXPECT_EQ(body_of(proxy.response()), "<https>");
}

TEST(TlsSession, TakesTheClientFromTheHeaderOfATrustedProxyAlone) {
  const auto who = [](api::Request& r) { return ProbeGateway::text("<" + r.remote + ">"); };
  const std::string from_7 = "PROXY TCP4 192.0.2.7 192.0.2.1 5000 443\r\n",
                    from_9 = "PROXY TCP4 192.0.2.9 192.0.2.1 5000 443\r\n";
  auto options = quick_options();
  options.is_proxy = [](std::string_view address) {
    return address == "127.0.0.1" || address == "192.0.2.9";
  };
  TestServer behind(options);
  behind.gateway.handler = who;
  behind.start();
  const auto answer = [&](const std::string& header) {
    RawSocket socket(behind.port);
    socket.send(header + k_get);
    return socket.response();
  };
  EXPECT_EQ(body_of(answer("")), "<127.0.0.1>");
  EXPECT_EQ(body_of(answer(from_7)), "<192.0.2.7>");
  EXPECT_EQ(body_of(answer(from_9 + from_7)), "<192.0.2.7>") << "one proxy behind another";
  EXPECT_EQ(status_of(answer(from_7 + from_9)), 400) << "a client's own header is none";
  EXPECT_EQ(body_of(answer(server::proxy_header("2001:db8::7", 1, "2001:db8::1", 2))), "<2001:db8::7>");
  RawSocket broken(behind.port);
  broken.send("PROXY TCP4 somebody\r\n" + std::string(k_get));
  EXPECT_TRUE(broken.read_to_end(seconds(5)));
  EXPECT_EQ(broken.input, "");
  RawSocket silent(behind.port);
  EXPECT_TRUE(silent.read_to_end(seconds(10))) << "it has the time of a head";

  TestServer open;
  open.gateway.handler = who;
  open.start();
  RawSocket stranger(open.port);
  stranger.send(from_7 + k_get);
  const auto refused = stranger.response();
  EXPECT_EQ(status_of(refused), 400);
  EXPECT_THAT(refused, HasSubstr("trusted_proxies does not list"));
}

TEST(TlsSession, AnswersPlainHttpInPlainHttp) {
  TlsServer server;
  RawSocket client(server.port);
  ASSERT_TRUE(client.send(k_get));
  const auto answer = client.response();
  EXPECT_EQ(status_of(answer), 400);
  EXPECT_THAT(answer, HasSubstr("https://"));
  EXPECT_TRUE(client.read_to_end());
}

TEST(TlsSession, EndsGarbageAndHalfHandshakesAtOnce) {
  TlsServer server;
  const std::string hello_head("\x16\x03\x01\x40\x00", 5);  // a record of 16384 bytes
  for (const std::string& bytes :
       {std::string("\x00\x01\x02\x03garbage", 11), std::string(5000, '\xff'), std::string("\r\n\r\n"),
        std::string("\x80\x2e\x01\x00\x02", 5), hello_head + std::string(16'384, 'x'),
        std::string("\x16\x00\x00\x00\x00\x00", 6)}) {
    RawSocket client(server.port);
    client.send(bytes);
    EXPECT_TRUE(client.read_to_end(seconds(5)));
  }
  RawSocket cut(server.port);
  cut.send(hello_head + "abc");
  cut.half_close();
  EXPECT_TRUE(cut.read_to_end(seconds(5)));
  TlsClient good(server.port, server.folder.ca());
  EXPECT_TRUE(good.open);
  EXPECT_GE(server.server.http.failed_handshakes(), 7u);
}

TEST(TlsSession, GivesASlowHandshakeItsTimeAndNoMore) {
  auto options = quick_options();
  options.limits.tls_handshake = milliseconds(300);
  TlsServer server(options);
  RawSocket silent(server.port), slow(server.port);
  slow.send(std::string("\x16\x03\x01\x02\x00\x01\x00\x01", 8));
  const auto begun = std::chrono::steady_clock::now();
  EXPECT_TRUE(silent.read_to_end(seconds(8)));
  EXPECT_TRUE(slow.read_to_end(seconds(8)));
  EXPECT_LT(std::chrono::steady_clock::now() - begun, seconds(5));
}

TEST(TlsSession, LetsAHandshakeGoFirstWhenPlacesRunOut) {
  auto options = quick_options();
  options.limits.max_connections = 2;
  TlsServer server(options);
  RawSocket silent(server.port), also_silent(server.port);
  TlsClient client(server.port, server.folder.ca());
  EXPECT_TRUE(client.open);
  EXPECT_TRUE(silent.read_to_end());
}

TEST(TlsSession, ExchangesTheCertificateUnderAnOpenConnection) {
  TlsServer server;
  TlsClient before(server.port, server.folder.ca());
  ASSERT_TRUE(before.open);
  server.folder.make("other.local", SystemClock{}.now(), 50);
  ASSERT_TRUE(server.keeper->reload(SystemClock{}.now()));
  TlsClient after(server.port, server.folder.ca());
  ASSERT_TRUE(after.open);
  EXPECT_NE(before.peer_serial(), after.peer_serial());
  ASSERT_TRUE(before.send(k_get));
  EXPECT_THAT(before.read_until("hello"), HasSubstr("200 OK"));
}

TEST(TlsSession, CarriesAWebSocket) {
  TlsServer server;
  server.server.gateway.make_peer = [] { return std::make_unique<EchoPeer>(); };
  TlsClient client(server.port, server.folder.ca());
  ASSERT_TRUE(
      client.send("GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                  "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n\r\n"));
  // RFC 6455 section 1.3: the answer to this key.
  EXPECT_THAT(client.read_until("\r\n\r\n"), HasSubstr("s3pPLMBiTxaQ9kYGzzhZRbK+xOo="));
  ASSERT_TRUE(client.send(std::string("\x81\x84\0\0\0\0ping", 10)));  // a text frame, masked by zeros
  EXPECT_THAT(client.read_until("ping"), HasSubstr("ping"));
  ASSERT_TRUE(client.send(std::string("\x88\x82\0\0\0\0\x03\xe8", 8)));  // close, 1000
  EXPECT_THAT(client.read_until("no such text"), HasSubstr("\x03\xe8"));
}

}  // namespace
}  // namespace anchord::tls_session_test
