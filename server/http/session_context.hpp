#pragma once

#include <atomic>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <unordered_map>

#include "server/http/gateway.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

class WorkerPool;

/// A connection that can be asked to end. stop() is called from any thread.
class Connection {
 public:
  virtual ~Connection() = default;
  virtual void stop() = 0;   ///< finish what runs, say goodbye, end
  virtual void abort() = 0;  ///< end now
};

/// What all sessions share; outlives them.
struct SessionContext {
  Gateway& gateway;
  WorkerPool& pool;         ///< ordinary handlers
  WorkerPool& stream_pool;  ///< handlers that wait for a body: a slow upload must not hold the others up
  HttpLimits limits{};
  WsLimits ws_limits{};
  HostPolicy hosts{};
  std::function<void(std::string_view what)> log_fault{};

  std::atomic<bool> stopping{false};
  std::atomic<std::size_t> connections{0};  ///< sockets, WebSockets included
  std::atomic<std::size_t> websockets{0};

  std::mutex mutex{};
  std::unordered_map<const Connection*, std::weak_ptr<Connection>> alive{};

  void enter(const Connection* key, std::weak_ptr<Connection> connection) {
    const std::lock_guard lock(mutex);
    alive.emplace(key, std::move(connection));
  }
  void leave(const Connection* key) {
    const std::lock_guard lock(mutex);
    alive.erase(key);
  }
};

}  // namespace anchord::server
