#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "api/stream/ws_handler.hpp"
#include "server/http/gateway.hpp"

namespace anchord::server {

/// Puts a conversation of the live protocol (text only) on a WebSocket session; binary messages close it with
/// 1003.
/// `place` is held for as long as the session lives.
std::unique_ptr<WsPeer> make_live_peer(std::unique_ptr<api::WsHandler> handler, std::shared_ptr<void> place);
/// Says nothing but why there is no place, and closes.
std::unique_ptr<WsPeer> make_refusing_peer(std::uint16_t code, std::string reason);

}  // namespace anchord::server
