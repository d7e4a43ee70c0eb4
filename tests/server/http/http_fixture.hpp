#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <numeric>
#include <string>

#include "api/kit/problem.hpp"
#include "server/http/gateway.hpp"
#include "server/http/http_server.hpp"
#include "server/runtime/worker_pool.hpp"
#include "tests/server/http/raw_socket.hpp"

namespace anchord::test {

/// A gateway without an application: routes that show what the transport did. Counts what it was asked.
class ProbeGateway final : public server::Gateway {
 public:
  server::Admission admit(api::Request& request, std::string_view, bool websocket) override {
    server::Admission admission;
    admission.body_limit = 100'000;
    admission.route = request.path;
    if (request.path == "/ws" && websocket && make_peer) {
      admission.websocket = make_peer;
      admission.subprotocol = request.header("sec-websocket-protocol");
    } else if (request.path == "/echo") {
      admission.run = [](api::Request& r) { return text(std::string(r.body)); };
    } else if (request.path == "/sum") {
      admission.streams_body = true;
      admission.body_limit = 4'000'000;
      admission.run = [](api::Request& r) {
        std::string piece(5000, '\0');
        std::size_t total = 0;
        try {
          while (const std::size_t n = r.body_stream->read(piece)) total += n;
        } catch (const api::BodyError& error) {
          return api::problem(error.status(), "malformed", error.what());
        }
        return text(std::to_string(total));
      };
    } else if (request.path == "/early") {
      admission.streams_body = true;
      admission.body_limit = 4'000'000;
      admission.run = [](api::Request&) { return api::problem(507, "read-only", "disk full"); };
    } else if (request.path == "/large") {
      admission.run = [](api::Request&) { return text(std::string(8'000'000, 'x')); };
    } else if (request.path == "/stream") {
      admission.run = [](api::Request&) {
        api::Response response;
        response.header("Content-Type", "text/plain");
        response.body_stream = [n = 0]() mutable {
          return n < 3 ? "piece" + std::to_string(n++) : std::string{};
        };
        return response;
      };
    } else if (request.path == "/hold") {
      admission.run = [this](api::Request&) {
        std::unique_lock lock(mutex);
        ++held;
        changed.notify_all();
        changed.wait(lock, [this] { return released; });
        return text("held");
      };
    } else if (request.path == "/heavy") {
      admission.work = [](const api::Request&) { return api::Work::heavy; };
      admission.share = std::string(request.header("x-token"));
      admission.run = [this](api::Request&) {
        std::unique_lock lock(mutex);
        ++held;
        changed.notify_all();
        changed.wait(lock, [this] { return released; });
        return text("computed");
      };
    } else if (request.path == "/command") {
      admission.work = [](const api::Request&) { return api::Work::command; };
      admission.run = [](api::Request&) { return text("held position"); };
    } else if (request.path == "/throw") {
      admission.run = [](api::Request&) -> api::Response { throw std::runtime_error("bug"); };
    } else if (request.path == "/denied") {
      admission.refusal = api::problem(401, "unauthorized", "no");
    } else if (handler) {
      admission.run = handler;
    } else {
      admission.run = [](api::Request&) { return text("hello"); };
    }
    return admission;
  }
  api::Response problem(int status, std::string_view type, std::string detail) override {
    return api::problem(status, type, std::move(detail));
  }
  void answered(const api::Request&, std::string_view, int, double, std::size_t) override {}

  static api::Response text(std::string body) {
    api::Response response;
    response.header("Content-Type", "text/plain");
    response.body = std::move(body);
    return response;
  }
  void wait_for_held(int n) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, std::chrono::seconds(10), [&] { return held >= n; });
  }
  void release() {
    const std::lock_guard lock(mutex);
    released = true;
    changed.notify_all();
  }

  std::function<std::unique_ptr<server::WsPeer>()> make_peer;
  std::function<api::Response(api::Request&)> handler;  ///< of any other path; unset: hello
  std::mutex mutex;
  std::condition_variable changed;
  int held{0};
  bool released{false};
};

inline server::HttpServerOptions quick_options() {
  using std::chrono::milliseconds;
  server::HttpServerOptions options;
  options.hosts.hosts = {"localhost"};
  options.limits.keep_alive = milliseconds(60'000);
  options.limits.linger = milliseconds(300);
  return options;
}

/// A listening server around the probe gateway; ends in the right order.
struct TestServer {
  explicit TestServer(server::HttpServerOptions options = quick_options(), std::size_t workers = 2,
                      std::size_t queue = 4)
      : pool("test-work", workers, queue),
        uploads("test-upload", 2, 4),
        commands("test-command", 1, 4),
        heavy("test-heavy", 2, 2),
        http(std::move(options), gateway, {pool, uploads, commands, pool, heavy}) {}
  ~TestServer() {
    gateway.release();
    http.stop(std::chrono::milliseconds(200));
    pool.stop();
    uploads.stop();
    commands.stop();
    heavy.stop();
  }
  void start() {
    port = http.listen("127.0.0.1:0").value();
    http.start();
  }
  ProbeGateway gateway;
  server::WorkerPool pool, uploads, commands, heavy;
  server::HttpServer http;
  std::uint16_t port{0};
};

}  // namespace anchord::test
