#pragma once

#include <memory>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "server/http/net.hpp"

namespace anchord::server {

/// "127.0.0.1:8420", "[::1]:8420", "localhost:0". Errors: invalid_argument.
Result<tcp::endpoint> parse_endpoint(std::string_view text);

/// Listens there. Errors: invalid_argument (not an address), conflict (in use), unsupported (no such address
/// here).
Result<std::shared_ptr<tcp::acceptor>> listen_at(asio::io_context& io, std::string_view text);

/// Accepts the next connection that comes; after an error it waits a moment, for without a pause a full
/// descriptor table would make the loop of the caller spin on the connection it cannot take. False: there is
/// no connection this time.
asio::awaitable<bool> accept_one(tcp::acceptor& acceptor, tcp::socket& socket);

/// A whole answer to one whose request is not even read: 503, and to try again.
std::string unread_503(std::string_view why);

}  // namespace anchord::server
