// The PROXY protocol as HAProxy's proxy-protocol.txt (2.1, 2.2) lays it out, byte for byte.
#include "server/http/proxy_header.hpp"

#include <gtest/gtest.h>

#include <random>

namespace anchord::server::proxy_header_test {
namespace {

using State = ProxyHeader::State;
using namespace std::string_literals;

const std::string k_signature = "\x0d\x0a\x0d\x0a\x00\x0d\x0a\x51\x55\x49\x54\x0a"s;

/// Everything but the whole of it is "more"; the whole, with something behind it, is `size` bytes.
void expect_whole(const std::string& header, const std::optional<std::string>& client) {
  for (std::size_t n = 0; n < header.size(); ++n)
    EXPECT_EQ(read_proxy_header(header.substr(0, n)).state, State::more) << n;
  const auto seen = read_proxy_header(header + "GET / HTTP/1.1\r\n");
  EXPECT_EQ(seen.state, State::whole);
  EXPECT_EQ(seen.size, header.size());
  EXPECT_EQ(seen.client, client);
}

TEST(ProxyHeader, OfVersion1NamesTheClient) {
  expect_whole("PROXY TCP4 192.168.0.1 192.168.0.11 56324 443\r\n", "192.168.0.1");
  expect_whole("PROXY TCP6 2001:db8::7 2001:db8::1 56324 443\r\n", "2001:db8::7");
  expect_whole("PROXY UNKNOWN\r\n", std::nullopt);
  expect_whole("PROXY UNKNOWN ffff:f...f:ffff ffff:f...f:ffff 65535 65535\r\n"s, std::nullopt);
}

TEST(ProxyHeader, OfVersion2NamesTheClient) {
  expect_whole(k_signature + "\x21\x11\x00\x0c\xc0\x00\x02\x07\xc6\x33\x64\x01\xdb\x04\x01\xbb"s,
               "192.0.2.7");
  expect_whole(k_signature + "\x21\x21\x00\x24"s + "\x20\x01\x0d\xb8"s + std::string(11, '\0') + "\x07" +
                   "\x20\x01\x0d\xb8"s + std::string(11, '\0') + "\x01" + "\xdb\x04\x01\xbb",
               "2001:db8::7");
  // What proxies add after the addresses (here a PP2_TYPE_NOOP of two bytes) belongs to the header.
  expect_whole(
      k_signature + "\x21\x11\x00\x11\xc0\x00\x02\x07\xc6\x33\x64\x01\xdb\x04\x01\xbb\x04\x00\x02\x00\x00"s,
      "192.0.2.7");
}

TEST(ProxyHeader, OfAHealthCheckOrAnotherNetworkNamesNobody) {
  expect_whole(k_signature + "\x20\x00\x00\x00"s, std::nullopt);                          // LOCAL
  expect_whole(k_signature + "\x21\x00\x00\x03"s + "abc", std::nullopt);                  // UNSPEC
  expect_whole(k_signature + "\x21\x31\x00\xd8"s + std::string(216, 'u'), std::nullopt);  // UNIX
}

TEST(ProxyHeader, IsNotSeenInHttpNorInTls) {
  for (const std::string& bytes :
       {"GET / HTTP/1.1\r\n"s, "POST /"s, "PATCH /"s, "PUT"s, "\r\nGET /"s, "\x16\x03\x01"s})
    EXPECT_EQ(read_proxy_header(bytes).state, State::none) << bytes;
}

TEST(ProxyHeader, ThatCannotBeReadIsBroken) {
  const std::string address = "\xc0\x00\x02\x07\xc6\x33\x64\x01\xdb\x04\x01\xbb"s;
  for (const std::string& bytes :
       {"PROXY TCP4 192.168.0.1\r\n"s, "PROXY TCP4 not-an-address 10.0.0.1 1 2\r\n"s,
        "PROXY TCP4 2001:db8::7 2001:db8::1 1 2\r\n"s, "PROXY UDP4 10.0.0.1 10.0.0.2 1 2\r\n"s, "PROXY \r\n"s,
        "PROXY TCP4 "s + std::string(120, '1'),
        k_signature + "\x11\x11\x00\x0c"s + address,     // version 1 in the form of version 2
        k_signature + "\x22\x11\x00\x0c"s + address,     // a command there is not
        k_signature + "\x21\x11\x00\x04"s + address,     // too short for two addresses
        k_signature + "\x21\x21\x00\x0c"s + address,     // too short for IPv6
        k_signature + "\x21\x11\xff\xff"s + address}) {  // longer than any proxy's
    EXPECT_EQ(read_proxy_header(bytes).state, State::broken) << bytes;
  }
}

TEST(ProxyHeader, IsReadBackAsItWasWritten) {
  EXPECT_EQ(proxy_header("192.0.2.7", 56068, "198.51.100.1", 443),
            k_signature + "\x21\x11\x00\x0c\xc0\x00\x02\x07\xc6\x33\x64\x01\xdb\x04\x01\xbb"s);
  expect_whole(proxy_header("2001:db8::7", 1, "2001:db8::1", 2), "2001:db8::7");
  EXPECT_EQ(proxy_header("192.0.2.7", 1, "2001:db8::1", 2), "");
  EXPECT_EQ(proxy_header("anchord.example", 1, "192.0.2.7", 2), "");
}

TEST(ProxyHeader, OfAnyBytesStaysInsideThem) {
  std::mt19937 random(7);
  for (int i = 0; i < 200'000; ++i) {
    std::string bytes = i % 2 == 0 ? k_signature + "\x21"s : "PROXY TCP"s;
    for (auto n = random() % 80; n > 0; --n) bytes += static_cast<char>(random());
    const auto seen = read_proxy_header(bytes);
    EXPECT_LE(seen.size, bytes.size());
    EXPECT_EQ(seen.size > 0, seen.state == State::whole);
  }
}

}  // namespace
}  // namespace anchord::server::proxy_header_test
