#include "server/http/http_wire.hpp"

#include <algorithm>
#include <array>
#include <utility>
#include <variant>

namespace anchord::server {
namespace {

using SteadyClock = std::chrono::steady_clock;
constexpr std::size_t k_head_read_bytes = 4096;

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

beast::tcp_stream HttpWire::take() {
  stream_.expires_never();
  return std::move(stream_);
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
    stream_.expires_at(deadline);
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
    stream_.expires_at(floor.deadline());
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
    stream_.expires_after(limits_.write_stall);
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
  stream_.socket().shutdown(tcp::socket::shutdown_send, ignored);
  if (ignored) co_return;
  const auto deadline = SteadyClock::now() + limits_.linger;
  buffer_.clear();
  for (std::size_t thrown = 0; thrown < 16 * limits_.drain_bytes;) {
    stream_.expires_at(deadline);
    const auto space = buffer_.prepare(k_head_read_bytes);
    const auto [error, n] = co_await stream_.async_read_some(space, k_wait);
    if (error) break;
    thrown += n;
  }
  close();
}

}  // namespace anchord::server
