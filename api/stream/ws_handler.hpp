#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "api/kit/message.hpp"

namespace anchord::api {

/// One WebSocket conversation, free of transport. All calls come from the session's strand; the wake function
/// handed to on_open may be called from any thread (and after the session ended: the session makes it
/// harmless).
class WsHandler {
 public:
  virtual ~WsHandler() = default;
  /// wake(): next_frame() or close_request() has something new.
  virtual void on_open(std::function<void()> wake) = 0;
  virtual void on_text(std::string_view message) = 0;
  virtual void on_close() = 0;
  /// Next text frame to write; null: nothing now. Shared: the same bytes go to many clients.
  virtual std::shared_ptr<const std::string> next_frame() = 0;
  /// Asked when next_frame() is null: code and reason to close with, when the handler wants that.
  virtual std::optional<std::pair<std::uint16_t, std::string>> close_request() = 0;
};

/// `holds`: does the login still stand? Asked several times a second, from any thread; must not wait.
using WsHandlerFactory =
    std::function<std::unique_ptr<WsHandler>(const Principal&, std::function<bool()> holds)>;

/// Who came in: whether that login still stands, as above, and what it may see. `holds` empty: nobody.
struct Listener {
  std::function<bool()> holds{};
  SiteSet sites{};
};
/// Lets in by a token that came in a message; nobody where it is not known, or may not listen.
using TokenDoor = std::function<Listener(std::string_view token)>;
/// Of a protocol whose clients send their token in a message: `first` is who came in by the handshake.
using TokenWsFactory = std::function<std::unique_ptr<WsHandler>(Listener first, TokenDoor door)>;

}  // namespace anchord::api
