#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "api/kit/message.hpp"
#include "api/kit/work.hpp"

namespace anchord::server {

/// One message to a WebSocket peer; empty pointer: nothing now.
struct WsFrame {
  std::shared_ptr<const std::string> bytes;
  bool binary{false};
};

/// The other end of a WebSocket session, free of transport. All calls come from the session's strand, one at
/// a time, and must be quick; `wake` may be called from any thread, also after the session has ended.
class WsPeer {
 public:
  virtual ~WsPeer() = default;
  virtual void on_open(std::function<void()> wake) = 0;
  virtual void on_message(std::string_view bytes, bool binary) = 0;
  virtual void on_close() = 0;
  virtual WsFrame next_frame() = 0;
  virtual std::optional<std::pair<std::uint16_t, std::string>> close_request() = 0;
};

/// What is to be done with a judged request, decided before its body is read.
struct Admission {
  std::optional<api::Response> refusal;  ///< answer this, whatever the body
  std::uint64_t body_limit{0};
  bool streams_body{false};
  bool quick{false};  ///< never blocks: runs on the io thread
  std::function<api::Work(const api::Request&)>
      work;           ///< which executor, once the body is whole; empty: ordinary
  std::string share;  ///< whose share of heavy work it takes; empty: only the queue bounds it
  std::function<api::Response(api::Request&)> run;
  std::function<std::unique_ptr<WsPeer>()> websocket;  ///< set: complete the upgrade
  std::string subprotocol;                             ///< answered in the upgrade; may be empty
  std::string route;                                   ///< template, for metrics: never the path
};

/// What the transport asks of the application. All calls come from io threads and must not block.
class Gateway {
 public:
  virtual ~Gateway() = default;
  /// Who is it, may they, and how is it done. `host` as the client reached us; `websocket`: asks for an
  /// upgrade.
  virtual Admission admit(api::Request& request, std::string_view host, bool websocket) = 0;
  /// An answer of the transport itself (bad head, too large, overloaded).
  virtual api::Response problem(int status, std::string_view type, std::string detail) = 0;
  /// Told once per answered request.
  virtual void answered(const api::Request& request, std::string_view route, int status, double seconds,
                        std::size_t bytes_out) = 0;
};

}  // namespace anchord::server
