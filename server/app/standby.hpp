#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "server/app/proxies.hpp"
#include "server/config/listeners.hpp"
#include "server/http/relay.hpp"

namespace anchord::server {

/// What a server does while another one has the database: it says so, and passes on what it is asked, where
/// both have told where they are reached (standby_url).
class Standby {
 public:
  /// Errors: invalid_argument (the settings do not go together).
  static Result<std::unique_ptr<Standby>> make(const Config& config, const std::vector<Listener>& listeners,
                                               const TrustedProxies& proxies);
  Standby(const Standby&) = delete;
  Standby& operator=(const Standby&) = delete;
  ~Standby() = default;

  /// This server `other` has the database, and is reached at `url`; empty: nobody knows where.
  void wait_for(std::string_view other, std::string_view url);

 private:
  Standby() = default;
  std::optional<ServerUrl> own_;
  RelayOptions options_;
  std::unique_ptr<Relay> relay_;  ///< listens for as long as this object lives
};

}  // namespace anchord::server
