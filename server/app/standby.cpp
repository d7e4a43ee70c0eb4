#include "server/app/standby.hpp"

#include <string>
#include <utility>

#include "server/runtime/logging.hpp"

namespace anchord::server {

Result<std::unique_ptr<Standby>> Standby::make(const Config& config, const std::vector<Listener>& listeners,
                                               const TrustedProxies& proxies) {
  std::unique_ptr<Standby> out(new Standby);
  const auto& url = config.text("standby_url");
  if (url.empty()) return out;
  const auto bad = [](const std::string& why) {
    return make_error(Errc::invalid_argument, "standby_url: " + why);
  };
  if (!config.flag("standby")) return bad("is of a server with --standby");
  auto own = parse_server_url(url);
  if (!own) return bad(own.error().message);
  out->own_ = std::move(own).value();
  auto& options = out->options_;
  options.tls = out->own_->tls;
  for (const auto& listener : listeners)
    if (listener.tls == options.tls) options.listen.push_back(listener.address);
  if (options.listen.empty())
    return bad("no address of listen speaks " + std::string(options.tls ? "https" : "http"));
  options.limits = http_limits(config);
  options.is_proxy = [proxies](std::string_view address) { return proxies.trusts(address); };
  return out;
}

void Standby::wait_for(std::string_view other, std::string_view url) {
  log(LogLevel::info, "standing by", {{"server", other}});
  if (!own_) return;
  const auto warn = [](std::string_view why) {
    log(LogLevel::warning, "requests are not passed on", {{"why", why}});
    return nullptr;
  };
  auto server = parse_server_url(url);
  // A relay that knows no server any more would send to the one before.
  if (!server) return void(relay_ = warn("the server that has the database has no standby_url"));
  if (server.value().tls != own_->tls)
    return void(relay_ = warn("one standby_url begins with https:// and the other with http://"));
  if (!relay_) {
    auto opened = Relay::open(options_);
    if (!opened) return void(warn(opened.error().message));
    relay_ = std::move(opened).value();
  }
  log(LogLevel::info, "passing requests on", {{"to", url}});
  relay_->pass_to(std::move(server).value());
}

}  // namespace anchord::server
