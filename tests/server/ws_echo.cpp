// An echo server on the product's own WebSocket session, for a conformance suite: ws_echo [HOST:PORT]
// [MAX_BYTES].
#include <signal.h>

#include <cstdio>
#include <cstdlib>

#include "api/kit/problem.hpp"
#include "server/http/http_server.hpp"
#include "server/runtime/worker_pool.hpp"
#include "tests/server/http/echo_peer.hpp"

namespace {

class EchoGateway final : public anchord::server::Gateway {
 public:
  anchord::server::Admission admit(anchord::api::Request&, std::string_view, bool websocket) override {
    anchord::server::Admission admission;
    if (websocket) {
      admission.websocket = [] { return std::make_unique<anchord::test::EchoPeer>(); };
    } else {
      admission.refusal = problem(426, "malformed", "this server speaks WebSocket only");
    }
    return admission;
  }
  anchord::api::Response problem(int status, std::string_view type, std::string detail) override {
    return anchord::api::problem(status, type, std::move(detail));
  }
  void answered(const anchord::api::Request&, std::string_view, int, double, std::size_t) override {}
};

}  // namespace

int main(int argc, char** argv) {
  using namespace anchord::server;
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  signal(SIGPIPE, SIG_IGN);
  EchoGateway gateway;
  WorkerPool pool("echo", 1, 16), uploads("echo", 1, 16);
  HttpServerOptions options;
  options.hosts.hosts = {"localhost", "127.0.0.1", "[::1]", "host.docker.internal"};
  options.ws_limits.message_bytes = argc > 2 ? static_cast<std::size_t>(std::atoll(argv[2])) : 16u << 20;
  options.ws_limits.max_fragments = 1u << 20;  // suites send megabytes in pieces of 64 bytes
  HttpServer server(options, gateway, {pool, uploads, pool, pool, pool});
  const std::string endpoint = argc > 1 ? argv[1] : "127.0.0.1:0";
  const auto port = server.listen(endpoint);
  if (!port) {
    std::fprintf(stderr, "%s\n", port.error().message.c_str());
    return 1;
  }
  std::printf("ws://%s:%u\n", endpoint.substr(0, endpoint.rfind(':')).c_str(),
              static_cast<unsigned>(port.value()));
  std::fflush(stdout);
  server.start();
  int received = 0;
  sigwait(&signals, &received);
  server.stop(std::chrono::seconds(1));
  return 0;
}
