#include "server/http/http_wire.hpp"

#include <openssl/ssl.h>

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

namespace anchord::server {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr std::size_t k_head_read_bytes = 4096;

/// Answer to plain HTTP where TLS is spoken.
std::string speaks_https() {
  const std::string body =
      R"({"type":"/problems/malformed","title":"The request is not well-formed","status":400,)"
      R"("detail":"this address uses HTTPS: write https://"})";
  return "HTTP/1.1 400 Bad Request\r\nContent-Type: application/problem+json\r\nContent-Length: " +
         std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body;
}

/// Answer to a proxy whose word about its clients is not taken.
Refusal not_trusted() {
  return {400, "malformed",
          "the connection begins with the PROXY protocol, and trusted_proxies does not list the address it "
          "comes from"};
}

}  // namespace

std::string HttpWire::remote() {
  error_code ignored;
  const auto peer = stream_.socket().remote_endpoint(ignored);
  return peer.address().to_string(ignored);
}

void HttpWire::close() {
  error_code ignored;
  stream_.socket().close(ignored);
}

WireStream HttpWire::take() {
  stream_.next_layer().expires_never();
  return std::move(stream_);
}

asio::awaitable<std::optional<ProxyHeader>> HttpWire::take_proxy_header() {
  const auto deadline = SteadyClock::now() + limits_.head_time;
  for (;;) {
    auto seen = read_proxy_header(buffered());
    if (seen.state == ProxyHeader::State::broken) co_return std::nullopt;
    if (seen.state != ProxyHeader::State::more) {
      buffer_.consume(seen.size);
      co_return seen;
    }
    idle_ = buffer_.size() == 0;
    stream_.next_layer().expires_at(deadline);
    const auto space = buffer_.prepare(k_head_read_bytes);
    const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
    idle_ = false;
    if (error) co_return std::nullopt;
    buffer_.commit(n);
  }
}

asio::awaitable<bool> HttpWire::secure(ssl_st* session) {
  std::unique_ptr<ssl_st, void (*)(ssl_st*)> owned(session, SSL_free);
  if (!owned) co_return false;
  struct Idle {
    bool& idle;
    ~Idle() { idle = false; }
  } const waiting{idle_};
  idle_ = true;
  const auto deadline = SteadyClock::now() + limits_.tls_handshake;
  stream_.next_layer().expires_at(deadline);
  if (buffer_.size() == 0) {
    const auto space = buffer_.prepare(k_head_read_bytes);
    const auto [no_hello, n] = co_await stream_.async_read_some(space, k_wait);
    if (no_hello) co_return false;
    buffer_.commit(n);
  }
  if (const auto bytes = buffered(); bytes.front() >= 'A' && bytes.front() <= 'Z') {
    const std::string answer = speaks_https();
    const bool sent = co_await write(answer, {});
    if (sent) co_await say_goodbye();
    co_return false;
  }
  // A record of a handshake (RFC 8446 section 5.1) begins with 22; nothing else is worth OpenSSL's time.
  if (buffered().front() != 22) co_return false;
  auto& tls = stream_.begin_tls(owned.release());
  stream_.next_layer().expires_at(deadline);
  const auto hello = buffer_.data();
  const auto [error, used] = co_await tls.async_handshake(WireStream::Tls::server, hello, k_wait);
  if (error) co_return false;
  buffer_.consume(used);
  co_return buffer_.size() == 0;  // bytes that were sent before the keys were known
}

std::string_view HttpWire::buffered() const {
  const auto bytes = buffer_.cdata();
  return {static_cast<const char*>(bytes.data()), bytes.size()};
}

asio::awaitable<HttpWire::Head> HttpWire::read_head(bool first, const std::atomic<bool>& stopping) {
  HeadScan scan;
  if (buffer_.size() == 0) buffer_.shrink_to_fit();  // an idle connection holds no buffer
  bool started = buffer_.size() != 0;
  auto deadline = SteadyClock::now() + (first || started ? limits_.head_time : limits_.keep_alive);
  for (;;) {
    if (first && read_proxy_header(buffered()).state == ProxyHeader::State::whole)
      co_return Head{0, not_trusted()};
    // RFC 9112 section 2.2: an empty line before the request line is a habit of old clients.
    while (scan.scanned == 0 && buffered().starts_with("\r\n")) buffer_.consume(2);
    if (const auto bytes = buffered(); !bytes.empty() && !(bytes == "\r" && scan.scanned == 0)) {
      auto seen = scan_head(bytes, scan, limits_);
      if (auto* refusal = std::get_if<Refusal>(&seen)) co_return Head{0, std::move(*refusal)};
      scan = std::get<HeadScan>(seen);
      if (scan.head_end != 0) co_return Head{scan.head_end, std::nullopt};
    }
    if (!started && stopping) co_return Head{};
    idle_ = !started;
    stream_.next_layer().expires_at(deadline);
    const auto space = buffer_.prepare(k_head_read_bytes);
    const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
    idle_ = false;
    if (error) co_return Head{};
    buffer_.commit(n);
    if (!started) {
      started = true;
      deadline = SteadyClock::now() + limits_.head_time;
    }
  }
}

asio::awaitable<HttpWire::Piece> HttpWire::next_piece(RequestParser& parser, RateFloor& floor,
                                                      std::span<char> out) {
  for (;;) {
    auto step = parser.decode(buffered(), out);
    buffer_.consume(step.consumed);
    if (step.refusal) co_return Piece{0, false, std::move(step.refusal)};
    if (step.produced > 0 || step.done) co_return Piece{step.produced, false, std::nullopt};
    stream_.next_layer().expires_at(floor.deadline());
    const auto space =
        buffer_.prepare(std::max<std::size_t>(limits_.read_buffer_bytes - buffer_.size(), 4096));
    const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
    if (error) co_return Piece{0, true, std::nullopt};
    floor.received(SteadyClock::now(), n);
    buffer_.commit(n);
  }
}

asio::awaitable<bool> HttpWire::write(std::string_view a, std::string_view b) {
  while (!a.empty() || !b.empty()) {
    const std::array<asio::const_buffer, 2> buffers{asio::buffer(a.data(), a.size()),
                                                    asio::buffer(b.data(), b.size())};
    stream_.next_layer().expires_after(limits_.write_stall);
    const auto [error, n] = co_await stream_.async_write_some(buffers, k_wait);
    if (error) co_return false;
    bytes_out_ += n;
    const std::size_t of_a = std::min(n, a.size());
    a.remove_prefix(of_a);
    b.remove_prefix(n - of_a);
  }
  co_return true;
}

asio::awaitable<void> HttpWire::say_goodbye() {
  error_code ignored;
  const auto deadline = SteadyClock::now() + limits_.linger;
  if (stream_.tls() != nullptr) {
    stream_.next_layer().expires_at(deadline);
    // Says that the answer is whole. What the peer still sends ends it early, and is thrown away below.
    co_await stream_.tls()->async_shutdown(k_wait);
  }
  stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  if (ignored) co_return;
  buffer_.clear();
  for (std::size_t thrown = 0; thrown < 16 * limits_.drain_bytes;) {
    stream_.next_layer().expires_at(deadline);
    const auto space = buffer_.prepare(k_head_read_bytes);
    const auto [error, n] = co_await stream_.next_layer().async_read_some(space, k_wait);
    if (error) break;
    thrown += n;
  }
  close();
}

}  // namespace anchord::server
