#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "server/http/http_client.hpp"

namespace anchord::sync {

struct PeerOptions {
  std::string url, token;
  std::string token_option;          ///< of the command line, for the error text
  std::chrono::seconds give_up{60};  ///< after so long without a useful answer
  std::function<void(const std::string& line)> report;
};

struct PeerRequest {
  std::string_view method;
  std::string target;
  std::string_view body{};
  std::string_view type{"application/json"};
  std::string idempotency_key{};
  bool bundle{false};  ///< made or taken in before the answer: minutes instead of seconds
};

/// A server that is spoken to. Everything asked of it may be asked twice: what it takes it knows by id,
/// digest or Idempotency-Key. Tries again while it is away or busy, as long as it says (Retry-After). One
/// thread.
class Peer {
 public:
  /// errors: invalid_argument
  static Result<std::unique_ptr<Peer>> to(const PeerOptions& options);

  const std::string& url() const { return options_.url; }
  /// Any answer that is not "again later". errors: link_lost (gave up), storage_full (507),
  /// invalid_argument (401, 403)
  Result<server::ClientResponse> call(const PeerRequest& request);
  /// Body of the 2xx as a JSON object. errors: as call; not_found, conflict and invalid_argument of the
  /// answer
  Result<nlohmann::json> get(const std::string& target);
  /// Every item (or feature) of a listing, over all of its pages; each is an object.
  Result<std::vector<nlohmann::json>> list(const std::string& target);
  /// An error about an answer that no anchord gives.
  Error stranger(const std::string& target, const std::string& what) const;

 private:
  Peer(PeerOptions options, server::HttpClient quick, server::HttpClient slow)
      : options_(std::move(options)), quick_(std::move(quick)), slow_(std::move(slow)) {}

  PeerOptions options_;
  server::HttpClient quick_, slow_;
};

/// "409 what the problem says"
std::string in_words(const server::ClientResponse& answer);
/// A member, whatever it is in; null where there is none.
const nlohmann::json& member(const nlohmann::json& object, const char* key);
/// A member's text; empty where there is none.
std::string text_of(const nlohmann::json& object, const char* key);

}  // namespace anchord::sync
