#pragma once

#include <array>
#include <boost/asio/any_completion_handler.hpp>
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
    return asio::async_initiate<Token, Signature>(
        [this](Done done, const Few<asio::mutable_buffer>& into) { read_some(into, std::move(done)); }, token,
        Few<asio::mutable_buffer>(buffers));
  }
  template <class Buffers, class Token>
  auto async_write_some(const Buffers& buffers, Token&& token) {
    return asio::async_initiate<Token, Signature>(
        [this](Done done, const Few<asio::const_buffer>& from) { write_some(from, std::move(done)); }, token,
        Few<asio::const_buffer>(buffers));
  }

 private:
  using Signature = void(error_code, std::size_t);
  /// Of one type whoever reads or writes, as are the buffers: what sockets and TLS do is compiled once, and
  /// not for each of the operations above it (it was 60 s and 1.2 MB of the WebSocket session alone).
  using Done = asio::any_completion_handler<Signature>;
  /// The first buffers of a sequence; what comes after them is for the next call.
  template <class Buffer>
  class Few {
   public:
    using value_type = Buffer;
    template <class Buffers>
    explicit Few(const Buffers& all) {
      auto at = asio::buffer_sequence_begin(all);
      for (const auto end = asio::buffer_sequence_end(all); at != end && n_ < k_most; ++at) {
        const Buffer one = *at;
        if (one.size() > 0) few_[n_++] = one;
      }
    }
    const Buffer* begin() const { return few_.data(); }
    const Buffer* end() const { return few_.data() + n_; }

   private:
    static constexpr std::size_t k_most = 8;
    std::array<Buffer, k_most> few_{};
    std::size_t n_{0};
  };
  void read_some(const Few<asio::mutable_buffer>& into, Done done);
  void write_some(const Few<asio::const_buffer>& from, Done done);

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
