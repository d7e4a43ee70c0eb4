#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "peer.hpp"

// Two links against each other over real sockets.

namespace anchord::link::link_test {
namespace {

using test::run_until;
using test::Seen;

std::string at_port(const char* scheme, const Seen& peer) {
  return scheme + std::string("127.0.0.1:") + std::to_string(peer.link->port());
}

std::unique_ptr<ByteLink> made(boost::asio::io_context& io, const std::string& address,
                               const LinkOptions& options = {}) {
  return make_link(io, parse_address(address).value(), options);
}

TEST(TcpLink, CarriesBytesBothWaysAndTellsThatTheOtherSideClosed) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  ASSERT_NE(server.link->port(), 0);
  EXPECT_FALSE(server.link->write("x"));
  Seen client(made(io, at_port("tcp://", server)));
  EXPECT_FALSE(client.link->write("x")) << "not connected yet";
  ASSERT_TRUE(run_until(io, [&] { return client.opens == 1 && server.opens == 1; }));
  const auto before = arrival_now();
  ASSERT_TRUE(client.link->write("to server"));
  ASSERT_TRUE(server.link->write("to "));
  ASSERT_TRUE(server.link->write("client"));
  ASSERT_TRUE(run_until(io, [&] { return server.text == "to server" && client.text == "to client"; }));
  EXPECT_GE(server.last.steady_ns, before.steady_ns);
  EXPECT_LE(server.last.steady_ns, arrival_now().steady_ns);
  EXPECT_EQ(client.link->counters().bytes_out, 9U);
  EXPECT_EQ(client.link->counters().bytes_in, 9U);
  server.link->close();
  ASSERT_TRUE(run_until(io, [&] { return client.why.has_value(); }));
  EXPECT_EQ(client.why->code, Errc::link_lost);
  EXPECT_NE(client.why->message.find("the other side closed the connection"), std::string::npos);
  EXPECT_FALSE(server.why) << "closing oneself is no news";
}

TEST(TcpLink, SaysThatNobodyListens) {
  boost::asio::io_context io;
  std::string address;
  {
    Seen gone(made(io, "tcp-listen://:0"));
    address = at_port("tcp://", gone);
  }
  Seen client(made(io, address));
  ASSERT_TRUE(run_until(io, [&] { return client.why.has_value(); }));
  EXPECT_EQ(client.why->code, Errc::not_found);
  EXPECT_NE(client.why->message.find("refused"), std::string::npos) << client.why->message;
  EXPECT_EQ(client.opens, 0);
}

TEST(TcpLink, GivesUpConnectingToAHostThatDoesNotAnswer) {
  boost::asio::io_context io;
  // Where the network swallows it the deadline ends the attempt; where it says "unreachable", that does.
  LinkOptions short_time;
  short_time.open_deadline_ms = 200;
  Seen client(made(io, "tcp://192.0.2.1:9", short_time));  // TEST-NET-1 of RFC 5737
  ASSERT_TRUE(run_until(io, [&] { return client.why.has_value(); }));
  EXPECT_EQ(client.opens, 0);
}

TEST(ListenLink, ServesTheNewestPeerWhoseBytesCameAndLetsTheOldOneGo) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  Seen first(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 1; })) << "it may wait to be asked";
  Seen second(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return second.opens == 1; }));
  ASSERT_TRUE(second.link->write("here"));
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 2 && first.why.has_value(); }));
  ASSERT_TRUE(server.link->write("hello"));
  ASSERT_TRUE(run_until(io, [&] { return second.text == "hello"; }));
  second.link->close();
  ASSERT_TRUE(run_until(io, [&] { return !server.link->is_open(); }));
  EXPECT_FALSE(server.why) << "it goes on listening";
  Seen third(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 3; }));
}

/// As port scans do, and neighbours that mistake the address.
TEST(ListenLink, KeepsADeviceThatSendsWhileOthersOnlyConnect) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  auto device = std::make_unique<Seen>(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 1 && device->opens == 1; }));
  std::vector<std::unique_ptr<Seen>> others;
  for (int i = 0; i < 20; ++i) {
    others.push_back(std::make_unique<Seen>(made(io, at_port("tcp://", server))));
    ASSERT_TRUE(run_until(io, [&] { return others.back()->opens == 1; }));
  }
  ASSERT_TRUE(device->link->write("5 m"));
  ASSERT_TRUE(run_until(io, [&] { return server.text == "5 m"; }));
  EXPECT_EQ(server.opens, 1);
  ASSERT_TRUE(server.link->write("next"));
  ASSERT_TRUE(run_until(io, [&] { return device->text == "next"; }));
  EXPECT_FALSE(device->why);
  EXPECT_EQ(server.link->counters().bytes_out, 4U);
  device->link->close();
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 2; })) << "one of those who wait is asked now";
}

/// Whoever can reach the port of an aircraft must not be able to cut it off by connecting.
TEST(ListenLink, KeepsItsPeerAgainstConnectionsWhoseBytesAreNotWelcome) {
  boost::asio::io_context io;
  const auto link = make_link(io, parse_address("tcp-listen://:0").value(), {});
  std::string in;
  int opens = 0;
  LinkHandlers handlers;
  handlers.on_open = [&] { ++opens; };
  handlers.on_bytes = [&](std::string_view bytes, const Arrival&) { in += bytes; };
  handlers.welcome = [](std::string_view bytes, const std::string& sender, const Arrival&) {
    EXPECT_TRUE(sender.starts_with("127.0.0.1:")) << sender;
    return bytes.starts_with("friend");
  };
  link->open(std::move(handlers));
  const std::string there = "tcp://127.0.0.1:" + std::to_string(link->port());
  Seen first(made(io, there));
  ASSERT_TRUE(run_until(io, [&] { return first.opens == 1; }));
  ASSERT_TRUE(first.link->write("friend 1"));
  ASSERT_TRUE(run_until(io, [&] { return in == "friend 1" && opens == 1; }));
  std::vector<std::unique_ptr<Seen>> strangers;
  for (int i = 0; i < 20; ++i) {
    strangers.push_back(std::make_unique<Seen>(made(io, there)));
    ASSERT_TRUE(run_until(io, [&] { return strangers.back()->opens == 1; }));
    ASSERT_TRUE(strangers.back()->link->write("stranger"));
  }
  ASSERT_TRUE(run_until(io, [&] { return strangers.front()->why.has_value(); })) << "they are bounded";
  ASSERT_TRUE(link->write("for the friend"));
  ASSERT_TRUE(run_until(io, [&] { return first.text == "for the friend"; }));
  EXPECT_FALSE(first.why);
  EXPECT_EQ(in, "friend 1");
  EXPECT_EQ(strangers.back()->text, "");
  Seen again(made(io, there));
  ASSERT_TRUE(run_until(io, [&] { return again.opens == 1; }));
  ASSERT_TRUE(again.link->write("friend 2"));
  ASSERT_TRUE(run_until(io, [&] { return in == "friend 1friend 2" && opens == 2 && first.why.has_value(); }));
}

TEST(ListenLink, SaysThatThePortIsTaken) {
  boost::asio::io_context io;
  Seen first(made(io, "tcp-listen://:0"));
  Seen second(made(io, "tcp-listen://:" + std::to_string(first.link->port())));
  ASSERT_TRUE(run_until(io, [&] { return second.why.has_value(); }));
  EXPECT_EQ(second.why->code, Errc::conflict);
}

TEST(UdpLink, AnswersTheLatestSenderAndKeepsDatagramsApart) {
  boost::asio::io_context io;
  Seen server(made(io, "udp://:0"));
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 1; }));
  EXPECT_FALSE(server.link->write("x")) << "nothing has been received yet";
  Seen client(made(io, at_port("udp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return client.opens == 1; }));
  ASSERT_TRUE(client.link->write("ping"));
  ASSERT_TRUE(run_until(io, [&] { return server.text == "ping"; }));
  ASSERT_TRUE(server.link->write("pong"));
  ASSERT_TRUE(run_until(io, [&] { return client.text == "pong"; }));
}

TEST(UdpLink, OutlivesADeviceThatIsNotThereYet) {
  boost::asio::io_context io;
  std::string address;
  {
    Seen gone(made(io, "udp://:0"));
    address = at_port("udp://", gone);
  }
  Seen client(made(io, address));
  ASSERT_TRUE(run_until(io, [&] { return client.opens == 1; }));
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(client.link->write("anybody?"));
    const auto sent = static_cast<std::uint64_t>(8 * (i + 1));
    run_until(io, [&] { return client.link->counters().bytes_out >= sent; });
  }
  EXPECT_FALSE(client.why);
}

TEST(Links, RefuseWhatDoesNotFitInTheirQueue) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  LinkOptions options;
  options.write_queue_bytes = 1 << 20;
  Seen client(made(io, at_port("tcp://", server), options));
  // The peer is accepted by the kernel, and nobody runs its reading side: the loop stops as soon as we are
  // open.
  ASSERT_TRUE(run_until(io, [&] { return client.opens == 1 && server.opens == 1; }));
  std::optional<Error> refused;
  const std::string block(256 * 1024, 'x');
  for (int i = 0; i < 100 && !refused; ++i) {
    if (const auto done = client.link->write(block); !done) refused = done.error();
  }
  ASSERT_TRUE(refused);
  EXPECT_EQ(refused->code, Errc::queue_full);
  EXPECT_EQ(client.link->counters().writes_refused, 1U);
}

TEST(Links, NothingIsCalledAfterClose) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  auto client = std::make_unique<Seen>(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return client->opens == 1 && server.opens == 1; }));
  ASSERT_TRUE(server.link->write("late"));
  client.reset();  // with bytes on their way
  Seen next(made(io, at_port("tcp://", server)));
  ASSERT_TRUE(run_until(io, [&] { return next.opens == 1 && server.opens == 2; }));
  EXPECT_TRUE(next.text.empty());
}

TEST(Links, MayBeClosedFromTheirOwnHandler) {
  boost::asio::io_context io;
  Seen server(made(io, "tcp-listen://:0"));
  auto link = made(io, at_port("tcp://", server));
  int bytes = 0;
  link->open({[] {},
              [&](std::string_view, const Arrival&) {
                ++bytes;
                link->close();
              },
              [](const Error&) { FAIL() << "closed by us"; }});
  ASSERT_TRUE(run_until(io, [&] { return server.opens == 1; }));
  ASSERT_TRUE(server.link->write("one"));
  ASSERT_TRUE(run_until(io, [&] { return bytes == 1; }));
  ASSERT_TRUE(run_until(io, [&] { return !server.link->is_open(); }));
}

}  // namespace
}  // namespace anchord::link::link_test
