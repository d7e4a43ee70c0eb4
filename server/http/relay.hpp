#pragma once

#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

/// Where another server answers.
struct ServerUrl {
  bool tls{false};
  std::string host;  ///< a name or an address, without brackets
  std::string port;
};
/// "http://10.0.0.7:8420", "https://[fd00::7]:8443". Errors: invalid_argument.
Result<ServerUrl> parse_server_url(std::string_view text);

struct RelayOptions {
  std::vector<std::string> listen;  ///< addresses, as HttpServer takes them
  bool tls{false};                  ///< of what is passed through these: bytes of TLS, which stay sealed
  HttpLimits limits{};
  std::function<bool(std::string_view address)> is_proxy{};
};

/// Passes connections on, byte by byte, to the server that has the database, with a PROXY header before them
/// that says who connected. A plain client whose server cannot be reached is answered 503.
class Relay {
 public:
  /// Errors: those of listening.
  static Result<std::unique_ptr<Relay>> open(RelayOptions options);
  /// Cuts what is connected, and listens no more.
  ~Relay();
  Relay(const Relay&) = delete;
  Relay& operator=(const Relay&) = delete;

  /// From now on new connections go there. Thread-safe.
  void pass_to(ServerUrl server);

 private:
  struct State;
  explicit Relay(std::shared_ptr<State> state);
  std::shared_ptr<State> state_;
};

}  // namespace anchord::server
