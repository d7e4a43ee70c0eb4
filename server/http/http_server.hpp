#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "server/http/executors.hpp"
#include "server/http/gateway.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

class TlsKeeper;

struct HttpServerOptions {
  HttpLimits limits{};
  WsLimits ws_limits{};
  HostPolicy hosts{};
  std::size_t io_threads{1};  ///< connections are on strands, so more is configuration
  /// Many ask from behind this address: its number of sockets is not limited by itself.
  std::function<bool(std::string_view address)> is_proxy{};
  std::shared_ptr<const TlsKeeper> tls{};  ///< of the listeners that speak TLS
};

/// Accepts connections and runs them. Hides Asio and Beast from its users.
class HttpServer {
 public:
  HttpServer(HttpServerOptions options, Gateway& gateway, Executors pools);
  /// stop(0).
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// "127.0.0.1:8420", "[::1]:8420"; port 0 lets the system choose. Returns the port.
  /// Errors: invalid_argument (not an address), conflict (in use), unsupported (no such address here).
  /// `tls`: HTTPS and wss there, by the options' certificate.
  Result<std::uint16_t> listen(std::string_view endpoint, bool tls = false);
  /// Runs `task` on an io thread, as often: between sockets, so it must be brief. Before start().
  void every(std::chrono::milliseconds period, std::string name, std::function<void()> task);
  void start();
  /// Takes no more work: listeners close, idle connections end, running requests finish, WebSockets get 1001.
  /// Then, at the latest after `grace`, whatever is left is cut. Idempotent.
  void stop(std::chrono::milliseconds grace);

  std::size_t connections() const;
  std::size_t websockets() const;
  /// Connections that spoke no TLS where it is spoken, or too slowly.
  std::uint64_t failed_handshakes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// Is this endpoint on the loopback interface? Errors: invalid_argument.
Result<bool> is_loopback(std::string_view endpoint);

}  // namespace anchord::server
