#include <netinet/in.h>
#include <netinet/tcp.h>

#include <atomic>
#include <boost/beast/http/empty_body.hpp>
#include <boost/beast/http/message.hpp>
#include <boost/beast/websocket/rfc6455.hpp>
#include <boost/beast/websocket/stream.hpp>
#include <boost/beast/websocket/stream_base.hpp>
#include <utility>

#include "core/base/guard.hpp"
#include "core/base/text.hpp"
#include "server/http/sessions.hpp"

namespace anchord::server {
namespace {

namespace http = beast::http;
namespace websocket = beast::websocket;
template <class T>
using awaitable = asio::awaitable<T>;

/// Linux: a socket takes no more while so much waits unsent. With 256 KiB of it a link of 1 Mbit/s showed
/// data two seconds old.
using NotSentLowat = asio::detail::socket_option::integer<IPPROTO_TCP, TCP_NOTSENT_LOWAT>;
constexpr int k_not_sent_bytes = 16 * 1024;

using UpgradeRequest = http::request<http::empty_body>;

/// One WebSocket connection: a reader, a writer with at most one write outstanding, and a pinger, all on one
/// strand. The peer holds the queue and its bound; nobody who makes messages ever waits for this session.
class WsSession final : public Connection, public std::enable_shared_from_this<WsSession> {
 public:
  WsSession(WireStream stream, std::shared_ptr<SessionContext> context, ConnectionSlot slot,
            std::unique_ptr<WsPeer> peer)
      : ws_(std::move(stream)),
        bell_(ws_.get_executor()),
        pulse_(ws_.get_executor()),
        stall_(ws_.get_executor()),
        context_(std::move(context)),
        slot_(std::move(slot)),
        peer_(std::move(peer)) {
    ++context_->websockets;
  }
  ~WsSession() override {
    --context_->websockets;
    context_->leave(this);
  }

  static awaitable<void> run(std::shared_ptr<WsSession> self, UpgradeRequest request,
                             std::string subprotocol) {
    self->context_->enter(self.get(), self->weak_from_this());
    self->configure(subprotocol);
    const auto [error] = co_await self->ws_.async_accept(request, k_wait);
    if (error) co_return;
    const Conversing conversing(*self);
    self->peer_->on_open([weak = self->weak_from_this()] {
      if (auto session = weak.lock()) session->wake();
    });
    self->spawn(write_all(self));
    self->spawn(ping_all(self));
    co_await self->read_all();
  }

  void stop() override {
    asio::post(ws_.get_executor(), [self = shared_from_this()] {
      self->going_away_ = true;
      self->bell_.cancel();
    });
  }
  void abort() override {
    asio::post(ws_.get_executor(), [self = shared_from_this()] { self->cut(); });
  }

  void spawn(awaitable<void> part) {
    asio::co_spawn(ws_.get_executor(), std::move(part),
                   [self = shared_from_this()](const std::exception_ptr& fault) {
                     if (!guarded_end("WebSocket", fault)) self->cut();
                   });
  }

 private:
  /// However the conversation ends (a close, an exception, the end of the io context), the peer is told
  /// before the session can go: whoever wakes it from another thread must not be the one who destroys it.
  class Conversing {
   public:
    explicit Conversing(WsSession& session) : session_(session) {}
    ~Conversing() {
      session_.closed_ = true;
      session_.bell_.cancel();
      session_.pulse_.cancel();
      session_.stall_.cancel();
      session_.peer_->on_close();
    }
    Conversing(const Conversing&) = delete;
    Conversing& operator=(const Conversing&) = delete;

   private:
    WsSession& session_;
  };

  void configure(const std::string& subprotocol) {
    const WsLimits& limits = context_->ws_limits;
    websocket::stream_base::timeout timeout{};
    timeout.handshake_timeout = limits.close_time;  // Beast uses it for the closing handshake too
    timeout.idle_timeout = limits.idle;
    // Without this Beast ends the session after idle_timeout whatever the peer sends. Its pings come at half
    // of it; ours have a shorter period.
    timeout.keep_alive_pings = true;
    ws_.set_option(timeout);
    ws_.read_message_max(limits.message_bytes);
    ws_.auto_fragment(false);
    ws_.set_option(websocket::stream_base::decorator([subprotocol](websocket::response_type& response) {
      response.set(http::field::server, "anchord");  // else Beast names itself and its version
      if (!subprotocol.empty()) response.set(http::field::sec_websocket_protocol, subprotocol);
    }));
    ws_.control_callback([this](websocket::frame_type kind, beast::string_view) {
      if (kind == websocket::frame_type::close) refuse_close_code();
    });
    error_code ignored;
    // A peer that does not read may hold this much in the kernel; without a bound it grows to megabytes. What
    // is not on its way yet waits here and not there: what is newer takes its place while it waits.
    beast::get_lowest_layer(ws_).socket().set_option(asio::socket_base::send_buffer_size(256 * 1024),
                                                     ignored);
    beast::get_lowest_layer(ws_).socket().set_option(NotSentLowat(k_not_sent_bytes), ignored);
  }

  /// Beast answers a close with the code that came, and takes codes for good that RFC 6455 section 7.4.2
  /// gives to nobody (5000 and above). Called before it answers: an answer of our own, begun here, is the
  /// only one.
  void refuse_close_code() {
    const auto code = static_cast<std::uint16_t>(ws_.reason().code);
    if (code < 5000 || !ws_.is_open() || std::exchange(closing_, true)) return;
    const websocket::close_reason reason(websocket::close_code::protocol_error, "invalid close code");
    ws_.async_close(reason, [self = shared_from_this()](const error_code&) {});
    if (ws_.is_open()) cut();  // a write is under way: ours would come after the echo
  }

  /// Reader, writer and the server's stop may all want the end; Beast ends the program when two closes are
  /// under way at once, so the first one is the only one.
  awaitable<void> close_once(websocket::close_reason reason) {
    if (std::exchange(closing_, true)) co_return;
    co_await ws_.async_close(reason, k_wait);
  }

  awaitable<void> read_all() {
    beast::flat_buffer buffer;
    std::size_t pieces = 0;  // each fragment takes at least one read
    for (;;) {
      const auto [error, n] = co_await ws_.async_read_some(buffer, 0, k_wait);
      if (error) co_return;
      if (!ws_.is_message_done()) {
        if (++pieces < context_->ws_limits.max_fragments) continue;
        const websocket::close_reason reason(websocket::close_code::too_big, "too many fragments");
        co_await close_once(reason);
        co_return;
      }
      pieces = 0;
      const auto bytes = buffer.cdata();
      const std::string_view message(static_cast<const char*>(bytes.data()), bytes.size());
      // Beast checks a text as it comes, but not that it is complete when the last fragment is empty.
      if (!ws_.got_binary() && !is_utf8(message)) {
        const websocket::close_reason reason(websocket::close_code::bad_payload, "the text is not UTF-8");
        co_await close_once(reason);
        co_return;
      }
      peer_->on_message(message, ws_.got_binary());
      buffer.consume(buffer.size());
      bell_.cancel();
    }
  }

  static awaitable<void> write_all(std::shared_ptr<WsSession> self) {
    while (!self->closed_) {
      const WsFrame frame = self->peer_->next_frame();
      if (frame.bytes) {
        self->ws_.binary(frame.binary);
        self->watch_for_stall();
        const auto buffer = asio::buffer(*frame.bytes);
        const auto [error, n] = co_await self->ws_.async_write(buffer, k_wait);
        self->stall_.cancel();
        if (error) co_return;
        continue;
      }
      auto goodbye = self->peer_->close_request();
      if (!goodbye && self->going_away_) goodbye.emplace(1001, "server stops");
      if (goodbye) {
        const websocket::close_reason reason(static_cast<websocket::close_code>(goodbye->first),
                                             goodbye->second);
        co_await self->close_once(reason);
        co_return;
      }
      self->bell_.expires_at(std::chrono::steady_clock::time_point::max());
      co_await self->bell_.async_wait(k_wait);
    }
  }

  static awaitable<void> ping_all(std::shared_ptr<WsSession> self) {
    while (!self->closed_) {
      self->pulse_.expires_after(self->context_->ws_limits.ping);
      co_await self->pulse_.async_wait(k_wait);
      if (self->closed_) co_return;
      const websocket::ping_data nothing{};
      const auto [error] = co_await self->ws_.async_ping(nothing, k_wait);
      if (error) co_return;
    }
  }

  /// From any thread. One post may be under way at a time: a thousand messages do not make a thousand posts.
  void wake() {
    if (woken_.exchange(true)) return;
    asio::post(ws_.get_executor(), [self = shared_from_this()] {
      self->woken_ = false;
      self->bell_.cancel();
    });
  }

  void watch_for_stall() {
    stall_.expires_after(context_->ws_limits.write_stall);
    stall_.async_wait([weak = weak_from_this()](const error_code& error) {
      if (error) return;
      if (auto self = weak.lock()) self->cut();
    });
  }

  void cut() {
    error_code ignored;
    beast::get_lowest_layer(ws_).socket().close(ignored);
    bell_.cancel();
    pulse_.cancel();
  }

  websocket::stream<WireStream, false> ws_;  // false: permessage-deflate is not even compiled in
  asio::steady_timer bell_, pulse_, stall_;
  std::shared_ptr<SessionContext> context_;
  ConnectionSlot slot_;
  std::unique_ptr<WsPeer> peer_;
  std::atomic<bool> woken_{false};
  bool closed_{false}, closing_{false}, going_away_{false};
};

}  // namespace

void start_ws_session(WireStream stream, std::shared_ptr<SessionContext> context, ConnectionSlot slot,
                      const api::Request& request, std::string subprotocol, std::unique_ptr<WsPeer> peer) {
  UpgradeRequest upgrade(http::verb::get, request.path, 11);
  for (const auto& [name, value] : request.headers) {
    if (name == "host" || name == "connection" || name == "upgrade" || name.starts_with("sec-websocket-")) {
      upgrade.set(name, value);
    }
  }
  auto session =
      std::make_shared<WsSession>(std::move(stream), std::move(context), std::move(slot), std::move(peer));
  session->spawn(WsSession::run(session, std::move(upgrade), std::move(subprotocol)));
}

}  // namespace anchord::server
