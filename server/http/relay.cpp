#include "server/http/relay.hpp"

#include <netinet/tcp.h>

#include <array>
#include <boost/asio/connect.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/write.hpp>
#include <charconv>

#include "core/base/guard.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"
#include "server/http/connection_book.hpp"
#include "server/http/endpoint.hpp"
#include "server/http/proxy_header.hpp"

namespace anchord::server {
namespace {

constexpr std::size_t k_piece_bytes = 32 * 1024;
constexpr auto k_connect_within = std::chrono::seconds(3);
/// Bytes that the other side does not acknowledge for so long: its machine or the way to it is gone.
constexpr unsigned k_unacknowledged_ms = 30'000;

/// Both ends of what is passed on.
struct Pair {
  Pair(tcp::socket from, std::shared_ptr<void> held)
      : client(std::move(from)),
        server(client.get_executor()),
        names(client.get_executor()),
        place(std::move(held)) {}
  tcp::socket client, server;
  tcp::resolver names;
  std::shared_ptr<void> place;
  void cut() {
    error_code ignored;
    client.close(ignored);
    server.close(ignored);
  }
};

void notice_loss(tcp::socket& socket) {
  error_code ignored;
  socket.set_option(tcp::no_delay(true), ignored);
  socket.set_option(asio::socket_base::keep_alive(true), ignored);
  (void)::setsockopt(socket.native_handle(), IPPROTO_TCP, TCP_USER_TIMEOUT, &k_unacknowledged_ms,
                     sizeof k_unacknowledged_ms);
}

/// Until one side ends what it sends; the end is passed on too.
asio::awaitable<void> pump(std::shared_ptr<Pair> pair, tcp::socket& from, tcp::socket& to) {
  std::array<char, k_piece_bytes> piece{};
  for (;;) {
    const auto [no_read, n] = co_await from.async_read_some(asio::buffer(piece), k_wait);
    if (no_read == asio::error::eof) {
      error_code ignored;
      to.shutdown(tcp::socket::shutdown_send, ignored);
      co_return;
    }
    if (no_read) break;
    const auto [no_write, written] = co_await asio::async_write(to, asio::buffer(piece.data(), n), k_wait);
    if (no_write) break;
  }
  pair->cut();
}

asio::awaitable<bool> connect(std::shared_ptr<Pair> pair, const ServerUrl& server) {
  asio::steady_timer limit(pair->client.get_executor(), k_connect_within);
  limit.async_wait([weak = std::weak_ptr<Pair>(pair)](const error_code& canceled) {
    const auto late = weak.lock();
    if (canceled || !late) return;
    late->names.cancel();
    error_code ignored;
    late->server.close(ignored);
  });
  const auto [unknown, found] = co_await pair->names.async_resolve(server.host, server.port, k_wait);
  if (unknown) co_return false;
  const auto [refused, at] = co_await asio::async_connect(pair->server, found, k_wait);
  co_return !refused;
}

std::string header_of(const tcp::socket& client) {
  error_code gone;
  const auto from = client.remote_endpoint(gone), to = client.local_endpoint(gone);
  if (gone) return {};
  return proxy_header(from.address().to_string(), from.port(), to.address().to_string(), to.port());
}

asio::awaitable<void> say_unreachable(std::shared_ptr<Pair> pair) {
  const std::string answer =
      unread_503("this server stands by, and the one that has the database does not answer it");
  const auto [error, n] = co_await asio::async_write(pair->client, asio::buffer(answer), k_wait);
  if (error) co_return;
  // Closing with unread bytes would reset the connection and take the answer with it.
  error_code ignored;
  pair->client.shutdown(tcp::socket::shutdown_send, ignored);
  asio::steady_timer limit(pair->client.get_executor(), std::chrono::seconds(1));
  limit.async_wait([weak = std::weak_ptr<Pair>(pair)](const error_code& canceled) {
    if (const auto late = weak.lock(); late && !canceled) late->cut();
  });
  std::array<char, 1024> thrown{};
  for (;;) {
    const auto [end, bytes] = co_await pair->client.async_read_some(asio::buffer(thrown), k_wait);
    if (end) co_return;
  }
}

asio::awaitable<void> pass_on(std::shared_ptr<Pair> pair, ServerUrl server) {
  const std::string header = header_of(pair->client);
  if (header.empty()) co_return;
  const bool connected = co_await connect(pair, server);
  if (!connected) {
    if (!server.tls) co_await say_unreachable(pair);
    co_return;
  }
  notice_loss(pair->client);
  notice_loss(pair->server);
  const auto [error, n] = co_await asio::async_write(pair->server, asio::buffer(header), k_wait);
  if (error) co_return;
  asio::co_spawn(pair->client.get_executor(), pump(pair, pair->server, pair->client),
                 [](const std::exception_ptr& fault) { (void)guarded_end("relay", fault); });
  co_await pump(pair, pair->client, pair->server);
}

}  // namespace

Result<ServerUrl> parse_server_url(std::string_view text) {
  const auto bad = [&] {
    return make_error(Errc::invalid_argument, "'" + to_utf8(text, 120) +
                                                  "' is not the address of a server like "
                                                  "https://anchord-a.example:8443 or http://10.0.0.7:8420");
  };
  ServerUrl out;
  for (const auto& [scheme, tls] : {std::pair{std::string_view("http://"), false}, {"https://", true}}) {
    if (!text.starts_with(scheme)) continue;
    out.tls = tls;
    std::string_view rest = text.substr(scheme.size());
    if (rest.ends_with('/')) rest.remove_suffix(1);
    const auto colon = rest.rfind(':');
    if (colon == std::string_view::npos) return bad();
    std::string_view host = rest.substr(0, colon);
    const std::string_view digits = rest.substr(colon + 1);
    std::uint16_t port = 0;
    const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
    if (digits.empty() || status != std::errc{} || end != digits.data() + digits.size() || port == 0)
      return bad();
    const bool v6 = host.starts_with('[') && host.ends_with(']');
    if (v6) host = host.substr(1, host.size() - 2);
    constexpr std::string_view k_name = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_";
    if (host.empty() || host.find_first_not_of(v6 ? "0123456789abcdefABCDEF:." : k_name) != host.npos)
      return bad();
    out.host = std::string(host);
    out.port = std::string(digits);
    return out;
  }
  return bad();
}

struct Relay::State {
  explicit State(RelayOptions wanted)
      : options(std::move(wanted)), book(options.limits.max_connections, options.limits.max_per_address) {}
  RelayOptions options;
  ConnectionBook book;
  Locked<ServerUrl> server{};
  asio::io_context io{1};
  std::vector<std::shared_ptr<tcp::acceptor>> acceptors;
  Thread thread;

  asio::awaitable<void> accept_all(std::shared_ptr<tcp::acceptor> acceptor) {
    for (;;) {
      tcp::socket socket(io);
      const bool accepted = co_await accept_one(*acceptor, socket);
      if (!accepted) continue;
      error_code ignored;
      const auto address = socket.remote_endpoint(ignored).address().to_string(ignored);
      auto entry = book.enter(address, options.is_proxy && options.is_proxy(address));
      if (!entry.place) {
        socket.non_blocking(true, ignored);
        if (!options.tls) socket.write_some(asio::buffer(unread_503(entry.why)), ignored);
        continue;
      }
      auto pair = std::make_shared<Pair>(std::move(socket), std::move(entry.place));
      asio::co_spawn(io, pass_on(std::move(pair), server.copy()),
                     [](const std::exception_ptr& fault) { (void)guarded_end("relay", fault); });
    }
  }
};

Result<std::unique_ptr<Relay>> Relay::open(RelayOptions options) {
  auto state = std::make_shared<State>(std::move(options));
  for (const auto& address : state->options.listen) {
    BOOST_OUTCOME_TRY(auto acceptor, listen_at(state->io, address));
    state->acceptors.push_back(std::move(acceptor));
  }
  return std::unique_ptr<Relay>(new Relay(std::move(state)));
}

Relay::Relay(std::shared_ptr<State> state) : state_(std::move(state)) {
  auto& s = *state_;
  for (const auto& acceptor : s.acceptors)
    asio::co_spawn(s.io, s.accept_all(acceptor),
                   [](const std::exception_ptr& fault) { (void)guarded_end("relay", fault); });
  s.thread = Thread("anchord-relay", [&s] { run_guarded("relay", s.io); });
}

Relay::~Relay() {
  state_->io.stop();
  state_->thread.join();
}

void Relay::pass_to(ServerUrl server) {
  auto current = state_->server.lock();
  *current = std::move(server);
}

}  // namespace anchord::server
