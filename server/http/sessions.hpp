#pragma once

#include <memory>
#include <string>

#include "server/http/net.hpp"
#include "server/http/session_context.hpp"
#include "server/http/wire_stream.hpp"

namespace anchord::server {

/// Counts one socket for as long as somebody holds it.
using ConnectionSlot = std::shared_ptr<void>;

/// Serves HTTP on a socket whose executor is a strand, until either side ends it; by TLS, if `tls`.
void start_http_session(tcp::socket socket, std::shared_ptr<SessionContext> context, ConnectionSlot slot,
                        bool tls);

/// Takes a connection over after its upgrade request was judged and admitted.
void start_ws_session(WireStream stream, std::shared_ptr<SessionContext> context, ConnectionSlot slot,
                      const api::Request& request, std::string subprotocol, std::unique_ptr<WsPeer> peer);

}  // namespace anchord::server
