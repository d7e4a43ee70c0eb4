#pragma once

#include <arpa/inet.h>
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <cstdint>

namespace anchord::test {

/// A TCP port of loopback for a program that takes a number, not a socket. One that was only bound and closed
/// may be anybody's a moment later. This one had a connection that this side closed first: for a minute
/// (TIME_WAIT) the system gives it to nobody who asks for any port, nor to an outgoing connection, but lets
/// who names it listen (SO_REUSEADDR).
inline std::uint16_t free_tcp_port() {
  const auto open = [] { return ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0); };
  sockaddr_in at{};
  at.sin_family = AF_INET;
  at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof at;
  auto* address = reinterpret_cast<sockaddr*>(&at);
  const int listener = open(), guest = open();
  const int reuse = 1;
  ::setsockopt(listener, SOL_SOCKET, SO_REUSEADDR, &reuse, sizeof reuse);
  EXPECT_EQ(::bind(listener, address, size), 0);
  EXPECT_EQ(::listen(listener, 1), 0);
  ::getsockname(listener, address, &size);
  EXPECT_EQ(::connect(guest, address, size), 0);
  ::close(::accept(listener, nullptr, nullptr));
  ::close(guest);
  ::close(listener);
  return ntohs(at.sin_port);
}

}  // namespace anchord::test
