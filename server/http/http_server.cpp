#include "server/http/http_server.hpp"

#include <algorithm>
#include <boost/asio/executor_work_guard.hpp>
#include <boost/asio/io_context.hpp>
#include <thread>

#include "core/base/check.hpp"
#include "core/base/guard.hpp"
#include "server/http/endpoint.hpp"
#include "server/http/sessions.hpp"

namespace anchord::server {

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
    while (!context->stopping) {
      tcp::socket socket(asio::make_strand(io));
      const bool accepted = co_await accept_one(*acceptor, socket);
      if (!acceptor->is_open()) co_return;
      if (!accepted) continue;
      error_code ignored;
      const auto address = socket.remote_endpoint(ignored).address().to_string(ignored);
      auto entry = context->book.enter(address, context->is_proxy && context->is_proxy(address));
      if (entry.evict) entry.evict->evict();
      if (!entry.place) {
        // In a handshake a plain answer would be garbage.
        const std::string answer = listener.tls ? std::string() : unread_503(entry.why);
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
  BOOST_OUTCOME_TRY(const auto acceptor, listen_at(state_->io, text));
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
