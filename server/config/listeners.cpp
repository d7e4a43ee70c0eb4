#include "server/config/listeners.hpp"

#include "server/http/http_server.hpp"

namespace anchord::server {
namespace {

constexpr std::string_view k_plain = "http://", k_secure = "https://";

}  // namespace

Result<std::vector<Listener>> listeners_of(const Config& config) {
  const bool certificate = !config.text("tls.certificate").empty();
  if (certificate == config.text("tls.key").empty())
    return make_error(Errc::invalid_argument,
                      "tls.certificate and tls.key belong together: one of them is not set ('anchord tls "
                      "init' creates both)");
  std::vector<Listener> out;
  for (const auto& entry : config.list("listen")) {
    Listener listener{entry, certificate};
    if (entry.starts_with(k_plain)) {
      listener = {entry.substr(k_plain.size()), false};
    } else if (entry.starts_with(k_secure)) {
      if (!certificate)
        return make_error(Errc::invalid_argument, "listen: " + entry + " needs tls.certificate and tls.key");
      listener = {entry.substr(k_secure.size()), true};
    }
    out.push_back(std::move(listener));
  }
  if (out.empty()) return make_error(Errc::invalid_argument, "listen: no address");
  return out;
}

Result<void> check_listeners(const Config& config, const std::vector<Listener>& listeners) {
  for (const auto& listener : listeners) {
    BOOST_OUTCOME_TRY(const bool loopback, is_loopback(listener.address));
    if (loopback) continue;
    if (config.text("auth") == "off") {
      return make_error(Errc::invalid_argument, "--auth=off is allowed on loopback addresses only; " +
                                                    listener.address +
                                                    " could be reached from other machines");
    }
    if (!listener.tls && !config.flag("insecure")) {
      return make_error(Errc::invalid_argument,
                        listener.address +
                            " can be reached from other machines and there is no TLS: give --tls-certificate "
                            "and --tls-key ('anchord tls init' creates them), use a TLS proxy in front of a "
                            "loopback address, or accept this with --insecure");
    }
  }
  return boost::outcome_v2::success();
}

}  // namespace anchord::server
