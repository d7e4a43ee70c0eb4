#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>

namespace anchord::server {

/// The PROXY protocol, versions 1 and 2 (HAProxy's proxy-protocol.txt): what a proxy that understands nothing
/// of HTTP puts before the bytes of its client, to say who that is. Only a trusted proxy is believed.

/// What the first bytes of a connection are.
struct ProxyHeader {
  enum class State : std::uint8_t {
    more,    ///< more bytes must come before it is known
    none,    ///< something else begins here
    whole,   ///< `size` bytes of header
    broken,  ///< a header that cannot be read: nothing on this connection can be trusted
  };
  State state{State::more};
  std::size_t size{0};
  std::optional<std::string>
      client{};  ///< nullopt: the proxy speaks for itself (a health check), or does not know
};
ProxyHeader read_proxy_header(std::string_view bytes);

/// Version 2, of a client at this address. `server`: where it connected to. Both of one family; "" where
/// either is no address.
std::string proxy_header(std::string_view client, std::uint16_t client_port, std::string_view server,
                         std::uint16_t server_port);

}  // namespace anchord::server
