#include "server/http/http_server.hpp"

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/v6_only.hpp>
#include <charconv>
#include <thread>

#include "core/base/check.hpp"
#include "core/base/guard.hpp"
#include "core/base/text.hpp"
#include "server/http/sessions.hpp"

namespace anchord::server {
namespace {

/// Answer to one who finds no place, without reading what he asks.
std::string no_place(const std::string& why) {
  const std::string body =
      R"({"type":"/problems/overloaded","title":"The server is overloaded","status":503,"detail":")" + why +
      R"(; try again"})";
  return "HTTP/1.1 503 Service Unavailable\r\nRetry-After: 5\r\nContent-Type: application/problem+json\r\n"
         "Content-Length: " +
         std::to_string(body.size()) + "\r\nConnection: close\r\n\r\n" + body;
}

Result<tcp::endpoint> parse_endpoint(std::string_view text) {
  const auto bad = [&] {
    return make_error(Errc::invalid_argument,
                      "'" + to_utf8(text, 80) + "' is not an address like 127.0.0.1:8420 or [::1]:8420");
  };
  const auto colon = text.rfind(':');
  if (colon == std::string_view::npos) return bad();
  std::string_view host = text.substr(0, colon);
  const std::string_view digits = text.substr(colon + 1);
  if (host.starts_with('[') && host.ends_with(']')) host = host.substr(1, host.size() - 2);
  if (host == "localhost") host = "127.0.0.1";
  std::uint16_t port = 0;
  const auto [end, status] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  if (digits.empty() || status != std::errc{} || end != digits.data() + digits.size()) return bad();
  error_code error;
  const auto address = asio::ip::make_address(std::string(host), error);
  if (error) return bad();
  return tcp::endpoint(address, port);
}

bool out_of_descriptors(const error_code& error) {
  return error == asio::error::no_descriptors || error.value() == ENFILE ||
         error == asio::error::no_buffer_space || error == asio::error::no_memory;
}

}  // namespace

struct HttpServer::State {
  std::shared_ptr<SessionContext> context;
  asio::io_context io;
  asio::executor_work_guard<asio::io_context::executor_type> work{io.get_executor()};
  struct Listener {
    std::shared_ptr<tcp::acceptor> acceptor;
    bool tls{false};
  };
  std::vector<Listener> listeners;
  std::vector<Thread> threads;
  std::size_t io_threads{1};
  bool stopped{false};

  /// At a fixed rate; a round that came late is not made up for.
  static asio::awaitable<void> repeat(std::chrono::milliseconds period, std::string name,
                                      std::function<void()> task) {
    asio::steady_timer timer(co_await asio::this_coro::executor);
    for (auto due = std::chrono::steady_clock::now();;) {
      due = std::max(due + period, std::chrono::steady_clock::now());
      timer.expires_at(due);
      co_await timer.async_wait(k_wait);
      (void)guarded(name, task);
    }
  }

  static asio::awaitable<void> accept_all(Listener listener, std::shared_ptr<SessionContext> context,
                                          asio::io_context& io) {
    const auto acceptor = listener.acceptor;
    asio::steady_timer pause(acceptor->get_executor());
    while (!context->stopping) {
      tcp::socket socket(asio::make_strand(io));
      const auto [error] = co_await acceptor->async_accept(socket, k_wait);
      if (error == asio::error::operation_aborted || !acceptor->is_open()) co_return;
      if (error) {
        // Without a pause a full descriptor table would make this loop spin on the connection it cannot take.
        pause.expires_after(std::chrono::milliseconds(out_of_descriptors(error) ? 200 : 10));
        co_await pause.async_wait(k_wait);
        continue;
      }
      error_code ignored;
      const auto address = socket.remote_endpoint(ignored).address().to_string(ignored);
      auto entry = context->book.enter(address, context->is_proxy && context->is_proxy(address));
      if (entry.evict) entry.evict->evict();
      if (!entry.place) {
        // In a handshake a plain answer would be garbage.
        const std::string answer = listener.tls ? std::string() : no_place(entry.why);
        socket.non_blocking(true, ignored);
        if (!answer.empty()) socket.write_some(asio::buffer(answer), ignored);
        socket.shutdown(tcp::socket::shutdown_both, ignored);
        continue;
      }
      socket.set_option(tcp::no_delay(true), ignored);
      ++context->connections;
      ConnectionSlot slot(nullptr,
                          [context, place = std::move(entry.place)](void*) { --context->connections; });
      start_http_session(std::move(socket), context, std::move(slot), listener.tls);
    }
  }
};

HttpServer::HttpServer(HttpServerOptions options, Gateway& gateway, Executors pools)
    : state_(std::make_unique<State>()) {
  state_->context = std::make_shared<SessionContext>(gateway, pools, options.limits, options.ws_limits);
  state_->context->hosts = std::move(options.hosts);
  state_->context->is_proxy = std::move(options.is_proxy);
  state_->context->tls = std::move(options.tls);
  state_->io_threads = options.io_threads;
}

HttpServer::~HttpServer() { stop(std::chrono::milliseconds(0)); }

Result<std::uint16_t> HttpServer::listen(std::string_view text, bool tls) {
  ANCHORD_CHECK(!tls || state_->context->tls, "a listener with TLS needs a certificate");
  BOOST_OUTCOME_TRY(const auto endpoint, parse_endpoint(text));
  auto acceptor = std::make_shared<tcp::acceptor>(state_->io);
  error_code error;
  acceptor->open(endpoint.protocol(), error);
  if (!error) acceptor->set_option(tcp::acceptor::reuse_address(true), error);
  if (!error && endpoint.address().is_v6()) acceptor->set_option(asio::ip::v6_only(true), error);
  if (!error) acceptor->bind(endpoint, error);
  if (!error) acceptor->listen(1024, error);
  if (error) {
    const auto code = error == asio::error::address_in_use ? Errc::conflict : Errc::unsupported;
    return make_error(code, "cannot listen on " + std::string(text) + ": " + error.message());
  }
  state_->listeners.push_back({acceptor, tls});
  return acceptor->local_endpoint().port();
}

void HttpServer::every(std::chrono::milliseconds period, std::string name, std::function<void()> task) {
  asio::co_spawn(state_->io, State::repeat(period, std::move(name), std::move(task)),
                 [](const std::exception_ptr& fault) { (void)guarded_end("timer", fault); });
}

void HttpServer::start() {
  auto& s = *state_;
  for (const auto& listener : s.listeners) {
    asio::co_spawn(s.io, State::accept_all(listener, s.context, s.io),
                   [](const std::exception_ptr& fault) { (void)guarded_end("listener", fault); });
  }
  for (std::size_t i = 0; i < s.io_threads; ++i) {
    s.threads.emplace_back("anchord-io", [&s] { run_guarded("connections", s.io); });
  }
}

void HttpServer::stop(std::chrono::milliseconds grace) {
  auto& s = *state_;
  if (s.stopped) return;
  s.stopped = true;
  s.context->stopping = true;
  const auto each = [&s](auto act) {
    // Whoever is the last to hold a connection ends it, and its end takes this lock: none ends below it.
    for (const auto& [key, weak] : s.context->alive.copy()) {
      if (const auto connection = weak.lock()) act(*connection);
    }
  };
  asio::post(s.io, [&s] {
    error_code ignored;
    for (const auto& listener : s.listeners) listener.acceptor->close(ignored);
  });
  const auto wait_until_none = [&s](std::chrono::steady_clock::time_point deadline) {
    while (s.context->connections.load() > 0 && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
  };
  if (!s.threads.empty()) {
    each([](Connection& connection) { connection.stop(); });
    wait_until_none(std::chrono::steady_clock::now() + grace);
    each([](Connection& connection) { connection.abort(); });
    wait_until_none(std::chrono::steady_clock::now() + std::chrono::milliseconds(500));
  }
  s.work.reset();
  s.io.stop();
  for (auto& thread : s.threads) thread.join();
  s.threads.clear();
}

std::size_t HttpServer::connections() const { return state_->context->connections; }
std::size_t HttpServer::websockets() const { return state_->context->websockets; }
std::uint64_t HttpServer::failed_handshakes() const { return state_->context->failed_handshakes; }

Result<bool> is_loopback(std::string_view endpoint) {
  BOOST_OUTCOME_TRY(const auto parsed, parse_endpoint(endpoint));
  return parsed.address().is_loopback();
}

}  // namespace anchord::server
