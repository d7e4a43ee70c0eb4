#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "server/http/http_client.hpp"

namespace anchord::sync {

struct PeerOptions {
  std::string url, token;
  std::chrono::seconds give_up{60};  ///< without any answer
  std::function<bool()> cancelled;
};

/// A server that is spoken to. Everything asked of it may be asked twice: what it takes it knows by id or
/// digest. Tries again while it is away or busy, as long as it says (Retry-After). One thread.
class Peer {
 public:
  /// errors: invalid_argument
  static Result<std::unique_ptr<Peer>> to(const PeerOptions& options);

  const std::string& url() const { return options_.url; }
  /// Any answer that is not "again later". errors: link_lost (gave up), canceled, invalid_argument (401, 403)
  Result<server::ClientResponse> call(std::string_view method, const std::string& target,
                                      const std::string& body = {},
                                      std::string_view type = "application/json");
  /// Body of the 2xx as JSON. errors: as call; not_found, conflict and invalid_argument of the answer
  Result<nlohmann::json> get(const std::string& target);
  /// Every item (or feature) of a listing, over all of its pages.
  Result<std::vector<nlohmann::json>> list(const std::string& target);

 private:
  Peer(PeerOptions options, server::HttpClient client)
      : options_(std::move(options)), client_(std::move(client)) {}
  bool pause(std::chrono::milliseconds length) const;

  PeerOptions options_;
  server::HttpClient client_;
};

/// "409 what the problem says"
std::string told(const server::ClientResponse& answer);
/// A member's text; empty where there is none.
std::string text_of(const nlohmann::json& object, const char* key);

}  // namespace anchord::sync
