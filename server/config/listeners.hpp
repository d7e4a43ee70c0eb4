#pragma once

#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/config/config.hpp"

namespace anchord::server {

/// One address that is listened on.
struct Listener {
  std::string address;  ///< "127.0.0.1:8420"
  bool tls{false};
};

/// The setting `listen` with `tls.certificate`: all of them speak TLS when there is a certificate, but for
/// those with http:// before them. Errors: invalid_argument (none, https:// without a certificate, half of
/// the pair).
Result<std::vector<Listener>> listeners_of(const Config& config);

/// The rules about who may reach the server from where (one place, so that no other path can listen).
/// Errors: invalid_argument.
Result<void> check_listeners(const Config& config, const std::vector<Listener>& listeners);

}  // namespace anchord::server
