#pragma once

#include <boost/asio/ssl/stream.hpp>
#include <boost/beast/core/role.hpp>
#include <boost/beast/websocket/ssl.hpp>
#include <boost/beast/websocket/teardown.hpp>
#include <memory>
#include <utility>

#include "server/http/net.hpp"

struct ssl_st;

namespace anchord::server {

/// The bytes of one connection, plain or by TLS: what is above sees one kind of stream, compiled once. A
/// plain read or write costs one branch more than the socket's own. Everything on the strand of the socket.
class WireStream {
 public:
  using Tls = asio::ssl::stream<beast::tcp_stream>;
  using next_layer_type = beast::tcp_stream;
  using executor_type = beast::tcp_stream::executor_type;

  explicit WireStream(tcp::socket socket) : plain_(std::move(socket)) {}

  executor_type get_executor() { return next_layer().get_executor(); }
  beast::tcp_stream& next_layer() { return tls_ ? tls_->next_layer() : plain_; }
  const beast::tcp_stream& next_layer() const { return tls_ ? tls_->next_layer() : plain_; }
  tcp::socket& socket() { return next_layer().socket(); }

  /// From here on by TLS; takes `session`. Before anything else was begun.
  Tls& begin_tls(ssl_st* session) {
    tls_ = std::make_unique<Tls>(std::move(plain_), session);
    return *tls_;
  }
  Tls* tls() { return tls_.get(); }

  template <class Buffers, class Token>
  auto async_read_some(const Buffers& buffers, Token&& token) {
    if (tls_) return tls_->async_read_some(buffers, std::forward<Token>(token));
    return plain_.async_read_some(buffers, std::forward<Token>(token));
  }
  template <class Buffers, class Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    if (tls_) return tls_->async_write_some(buffers, std::forward<Token>(token));
    return plain_.async_write_some(buffers, std::forward<Token>(token));
  }

 private:
  beast::tcp_stream plain_;
  std::unique_ptr<Tls> tls_;
};

/// How Beast's WebSocket ends the connection below it, found by the type of the stream.
template <class Handler>
void async_teardown(beast::role_type role, WireStream& stream, Handler&& handler) {
  using beast::websocket::async_teardown;
  if (auto* tls = stream.tls()) {
    async_teardown(role, *tls, std::forward<Handler>(handler));
  } else {
    async_teardown(role, stream.next_layer(), std::forward<Handler>(handler));
  }
}

}  // namespace anchord::server
