#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"

namespace anchord::gateway {

struct GatewayOptions {
  std::string to;                    ///< http://host:port of the server
  std::filesystem::path token_file;  ///< empty: no token is sent
  std::filesystem::path data_dir;
  std::vector<std::string> devices;  ///< "kind=address"; added when no device of devices.json has the address
  std::string listen{"127.0.0.1:8421"};
  std::optional<MissionId> mission{};
  std::uint64_t max_bytes{std::uint64_t{4} << 30};            ///< of the outbox
  bool new_outbox{false};                                     ///< also where one is missing
  std::uint64_t max_recording_bytes{std::uint64_t{8} << 30};  ///< beyond: the oldest parts go
  std::string version;
};

/// The devices of this machine, recorded as a server does it; their rows in an outbox, and from there to a
/// server. No flight is controlled, nothing is estimated here. Tells of itself on a loopback address.
class FieldGateway {
 public:
  /// Errors: invalid_argument (an address), conflict (folder or port in use), those of the outbox.
  static Result<std::unique_ptr<FieldGateway>> start(const GatewayOptions& options);
  ~FieldGateway();
  /// "http://127.0.0.1:8421"
  const std::string& url() const;
  /// What waits for the disk is kept, requests under way end. Idempotent; within 10 s.
  void stop();

 private:
  struct State;
  explicit FieldGateway(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace anchord::gateway
