#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::sim {

/// Where a simulated device can be reached. Never blocks; what a peer does not read is dropped beyond 64 KiB.
/// One thread.
class Port {
 public:
  struct Received {
    int peer{};  ///< which client; a pty has one, 0
    std::string bytes;
  };
  virtual ~Port() = default;
  /// Comes up, or comes up again after down(). errors: link_lost, conflict (address in use)
  virtual Result<void> up() = 0;
  virtual void down() = 0;
  virtual bool is_up() const = 0;
  /// New peers since the last call, and what they said.
  virtual std::vector<int> arrived() = 0;
  virtual std::vector<Received> receive() = 0;
  virtual void send(int peer, std::string_view bytes) = 0;
  virtual void send_all(std::string_view bytes) = 0;
  virtual bool anybody() const = 0;
  virtual std::vector<int> descriptors() const = 0;  ///< to wait on
  virtual std::string path() const { return {}; }    ///< of a pty now
  virtual std::uint16_t port() const { return 0; }   ///< of TCP
};

/// A pty; `link`, a symbolic link to it, stays where it is when the pty changes with the next plug.
std::unique_ptr<Port> make_pty(std::string link);
/// Listens on loopback; port 0: the system chooses, and keeps it. Any number of clients.
std::unique_ptr<Port> make_tcp(std::uint16_t port);

}  // namespace anchord::sim
