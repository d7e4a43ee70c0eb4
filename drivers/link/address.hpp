#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord::link {

enum class Kind : std::uint8_t { serial, tcp, tcp_listen, udp };

/// Where a device is. As text, the setting of the operator:
///   serial:/dev/serial/by-id/usb-Pozyx_...?baud=115200   a path that stays when the plug moves; ptys as well
///   tcp://192.168.2.15:9001                              we connect
///   tcp-listen://:9002  tcp-listen://127.0.0.1:9002      the device connects; port 0: the system chooses
///   udp://:14550  udp://0.0.0.0:14550                    we bind (loopback, or every network) and answer the
///                                                        latest sender that is welcome
///   udp://192.168.2.15:14550                             we send there and take what comes back from there
/// IPv6 hosts stand in brackets.
struct Address {
  Kind kind{Kind::serial};
  std::string path;  ///< serial
  std::string
      host;  ///< tcp: required; tcp_listen: bind address, empty = loopback; udp: remote, or where to bind
  std::uint16_t port{0};
  int baud{115200};  ///< serial
  bool operator==(const Address&) const = default;
};

/// errors: invalid_argument, naming the part that is wrong
Result<Address> parse_address(std::string_view text);
/// Whether its bytes pass a network that others may be on: any host but a loopback one.
bool others_may_reach(const Address& address);
/// The form parse_address() takes, defaults left out.
std::string to_string(const Address& address);

}  // namespace anchord::link
