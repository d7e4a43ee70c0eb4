#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>

#include "core/base/locked.hpp"
#include "server/http/connection_book.hpp"
#include "server/http/executors.hpp"
#include "server/http/gateway.hpp"
#include "server/http/limits.hpp"
#include "server/tls/tls_keeper.hpp"

namespace anchord::server {

/// A connection that can be asked to end. stop() is called from any thread.
class Connection {
 public:
  virtual ~Connection() = default;
  virtual void stop() = 0;   ///< finish what runs, say goodbye, end
  virtual void evict() {}    ///< end, if it waits for a request
  virtual void abort() = 0;  ///< end now
};

/// What all sessions share; outlives them.
struct SessionContext {
  Gateway& gateway;
  Executors pools;
  HttpLimits limits{};
  WsLimits ws_limits{};
  HostPolicy hosts{};
  std::function<bool(std::string_view address)> is_proxy{};
  std::shared_ptr<const TlsKeeper> tls{};  ///< null: no listener speaks TLS

  Shares heavy_shares{limits.heavy_per_token};
  ConnectionBook book{limits.max_connections, limits.max_per_address};

  std::atomic<bool> stopping{false};
  std::atomic<std::size_t> connections{0};  ///< sockets, WebSockets included
  std::atomic<std::size_t> websockets{0};
  std::atomic<std::uint64_t> failed_handshakes{0};

  Locked<std::unordered_map<const Connection*, std::weak_ptr<Connection>>> alive{};

  void enter(const Connection* key, std::weak_ptr<Connection> connection) {
    auto all = alive.lock();
    all->emplace(key, std::move(connection));
  }
  void leave(const Connection* key) {
    auto all = alive.lock();
    all->erase(key);
  }
};

}  // namespace anchord::server
