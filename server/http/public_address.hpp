#pragma once

#include <string_view>

namespace anchord::server {

/// Whether this is an address of the public internet: a global unicast one that no register (RFC 6890 and its
/// successors) keeps for machines, links, sites, documentation or tunnels. `address` is numeric, IPv4 or IPv6
/// without a zone; anything else is not public.
bool is_public_address(std::string_view address);

}  // namespace anchord::server
