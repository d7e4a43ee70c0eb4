#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "server/http/limits.hpp"
#include "server/http/net.hpp"
#include "server/http/proxy_header.hpp"
#include "server/http/rate_floor.hpp"
#include "server/http/request_check.hpp"
#include "server/http/request_parser.hpp"
#include "server/http/wire_stream.hpp"

namespace anchord::server {

/// The bytes of one HTTP connection: heads and pieces of bodies in, answers out, each read and write with its
/// deadline. Everything runs on the strand of the socket.
class HttpWire {
 public:
  HttpWire(tcp::socket socket, const HttpLimits& limits) : stream_(std::move(socket)), limits_(limits) {}

  auto executor() { return stream_.get_executor(); }
  std::string remote();
  void close();
  /// What the connection begins with, where a trusted proxy may say for whom it connects; a header is taken
  /// off. nullopt: the connection is over.
  asio::awaitable<std::optional<ProxyHeader>> take_proxy_header();
  /// The handshake of TLS with `session`, which it takes. False: the connection is over. Who speaks plain
  /// HTTP here gets a plain answer that says so; garbage gets none.
  asio::awaitable<bool> secure(ssl_st* session);
  bool secured() { return stream_.tls() != nullptr; }
  bool idle() const { return idle_; }  ///< between two requests
  /// The connection for somebody else, after a head that nothing followed.
  WireStream take();

  std::string_view buffered() const;
  void consume(std::size_t n) { buffer_.consume(n); }

  /// Both empty: the connection has ended, or `stopping` was seen between two requests.
  struct Head {
    std::size_t size{0};  ///< of the head, which is the beginning of buffered()
    std::optional<Refusal> refusal;
  };
  asio::awaitable<Head> read_head(bool first, const std::atomic<bool>& stopping);

  struct Piece {
    std::size_t produced{0};
    bool lost{false};  ///< the connection ended, or fell below the floor
    std::optional<Refusal> refusal;
    bool more() const { return !lost && !refusal; }
  };
  void expect_body() { buffer_.reserve(limits_.read_buffer_bytes); }
  /// The next decoded bytes of a body.
  asio::awaitable<Piece> next_piece(RequestParser& parser, RateFloor& floor, std::span<char> out);

  /// Writes both, in order; false when the peer is gone or makes no progress.
  asio::awaitable<bool> write(std::string_view a, std::string_view b);
  /// Bytes written since it was last asked.
  std::size_t take_bytes_out() { return std::exchange(bytes_out_, 0); }

  /// Half-closes and throws away what the peer still sends, for a moment: closing with unread bytes would
  /// reset the connection and take the answer with it.
  asio::awaitable<void> say_goodbye();

 private:
  WireStream stream_;
  beast::flat_buffer buffer_;
  const HttpLimits& limits_;
  std::size_t bytes_out_{0};
  bool idle_{false};
};

}  // namespace anchord::server
