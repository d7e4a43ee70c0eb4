#pragma once

#include <memory>

#include "api/live/ws_handler.hpp"
#include "server/http/gateway.hpp"

namespace anchord::server {

/// Puts a conversation of the live protocol (text only) on a WebSocket session; binary messages close it with
/// 1003.
std::unique_ptr<WsPeer> make_live_peer(std::unique_ptr<api::WsHandler> handler);

}  // namespace anchord::server
