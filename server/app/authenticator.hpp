#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "api/admin/access.hpp"
#include "api/kit/router.hpp"
#include "api/stream/ws_handler.hpp"
#include "server/app/metrics.hpp"
#include "server/app/proxies.hpp"
#include "server/app/rate_limit.hpp"
#include "server/app/ws_places.hpp"
#include "server/http/gateway.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

struct AuthenticatorOptions {
  HostPolicy hosts{};
  double rate_per_s{50}, rate_burst{200};
  TrustedProxies proxies{};
  WsPlaceLimits places{};
  /// The answer to a permitted GET where it is at hand; asked on io threads, never waits.
  std::function<std::optional<api::Response>(const api::Route&, const api::Request&)> at_hand{};
  double slow_s{0};  ///< a request that takes longer is logged; 0: none
};

/// Between the transport and the application: who asks, from which page, how often, and which route answers.
/// Denies by default: what no route and no file claims is refused. Called on io threads; never blocks.
class Authenticator final : public Gateway {
 public:
  Authenticator(const api::Router& router, api::WsHandlerFactory live, api::TokenWsFactory omlox,
                api::AccessService& access, Metrics& metrics, AuthenticatorOptions options);

  Admission admit(api::Request& request, std::string_view host, bool websocket) override;
  api::Response problem(int status, std::string_view type, std::string detail) override;
  void answered(const api::Request& request, std::string_view route, int status, double seconds,
                std::size_t bytes_out) override;
  /// From now on everything new gets 503.
  void close() { closed_ = true; }

 private:
  std::optional<api::Response> identify(api::Request& request, bool websocket, api::Login& login);
  api::Response wrong_secret(const api::Request& request, std::string_view secret, std::string_view what);
  std::optional<api::Response> limit(const api::Request& request, const api::Resolution& found);
  std::optional<api::Response> quota(const api::Request& request, const api::Resolution& found);
  Admission live(api::Request& request, bool websocket, api::Login login);
  Admission live_omlox(const api::Request& request, bool websocket, const api::Login& login);
  /// Whether this login stands; holds its place among the live connections for as long as it is kept.
  std::function<bool()> standing(const api::Login& login, std::shared_ptr<void> place);
  /// Longer than it should have taken: not where the client asked to wait.
  bool is_slow(const api::Request& request, double seconds) const;
  api::Listener let_in(const api::Request& request, std::string_view token);
  Admission at_once(Admission admission, const api::Route& route, api::Response& answer);
  Admission decide(api::Request& request, std::string_view host, bool websocket);
  api::Response run(const api::Route& route, api::Request& request, const api::Login& login);

  const api::Router& router_;
  api::WsHandlerFactory live_;
  api::TokenWsFactory omlox_;
  api::AccessService& access_;
  Metrics& metrics_;
  AuthenticatorOptions options_;
  RateLimit rate_, quotas_;
  WsPlaces places_;
  WsPlaces strangers_;  ///< whose token is still to come
  std::atomic<bool> closed_{false};
};

}  // namespace anchord::server
