#pragma once

#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/result.hpp"
#include "server/http/http_client.hpp"

namespace anchord::sync {

class Spool;

struct PeerOptions {
  std::string url, token;
  std::string token_option;          ///< of the command line, for the error text
  std::string role;                  ///< that the token must have, for the same
  std::chrono::seconds give_up{60};  ///< after so long without a useful answer
  std::chrono::seconds timeout{30};  ///< within which an answer begins; of a bundle 20 times as long
  std::function<void(const std::string& line)> report;
};

/// Most that an answer may have: of what is read as JSON, and of a file that is passed on.
inline constexpr std::uint64_t k_most_answer_bytes = std::uint64_t{8} << 20;
inline constexpr std::uint64_t k_most_bundle_bytes = std::uint64_t{2} << 30;

struct PeerRequest {
  std::string_view method;
  std::string target;
  std::string_view body{};
  std::string_view type{"application/json"};
  std::map<std::string, std::string> headers{};
  const Spool* from{nullptr};  ///< all of it is the body, or the part below
  std::uint64_t from_at{0};
  std::optional<std::uint64_t> from_bytes{};
  const Spool* into{nullptr};  ///< becomes the body of a 200
  std::uint64_t into_at{0};    ///< a 206 goes on from here
  std::function<Result<void>(const server::ClientResponse& head)>
      begins{};  ///< before the first byte of that
  std::uint64_t most_bytes{k_most_answer_bytes};
  bool bundle{false};  ///< made or taken in before the answer: minutes instead of seconds
  bool once{false};    ///< a link that is lost ends the call
};

/// A server that is spoken to, and may be any: an answer is bounded in length and time. Everything asked of
/// it may be asked twice: what it takes it knows by id, digest or Idempotency-Key. Tries again while it is
/// away or busy, as long as it says (Retry-After). One thread.
class Peer {
 public:
  /// errors: invalid_argument
  static Result<std::unique_ptr<Peer>> to(const PeerOptions& options);

  const std::string& url() const { return options_.url; }
  /// Any answer that is not "again later". errors: link_lost (gave up), storage_full (507, or the disk here),
  /// invalid_argument (401, 403, an answer that is too long)
  Result<server::ClientResponse> call(const PeerRequest& request);
  /// Attempts one after the other, each until its link is lost, as long as `arrived` bytes grow or the link
  /// is back in time. errors: as call
  Result<server::ClientResponse> go_on(const std::function<Result<server::ClientResponse>()>& attempt,
                                       const std::function<std::uint64_t()>& arrived);
  /// Body of the 2xx as a JSON object. errors: as call; not_found, conflict and invalid_argument of the
  /// answer
  Result<nlohmann::json> get(const std::string& target);
  /// Every item (or feature) of a listing, over all of its pages; each is an object. An error ends it.
  Result<void> each(const std::string& target,
                    const std::function<Result<void>(const nlohmann::json& item)>& take);
  /// The same, kept: 64 MB of text at most, which are half a million flights by id, name and state.
  Result<std::vector<nlohmann::json>> list(const std::string& target);
  /// From now on a web page in place of an answer is a link that is lost: this address is an anchord
  /// server's, and a guest network that wants somebody to sign in goes again.
  void set_known() { known_ = true; }
  /// An error about an answer that no anchord gives.
  Error stranger(const std::string& target, const std::string& what) const;

 private:
  Peer(PeerOptions options, server::HttpClient quick, server::HttpClient slow)
      : options_(std::move(options)), quick_(std::move(quick)), slow_(std::move(slow)) {}
  Result<server::ClientResponse> once(const PeerRequest& request);
  /// errors: link_lost (a page of somebody on the way)
  Result<void> is_server(const std::string& target, const server::ClientResponse& head) const;

  PeerOptions options_;
  server::HttpClient quick_, slow_;
  bool known_{false};
};

/// "409 what the problem says"
std::string in_words(const server::ClientResponse& answer);
/// Body of an answer as JSON, in whatever it is in; null where it is none.
nlohmann::json json_of(const server::ClientResponse& answer);
/// A member, whatever it is in; null where there is none.
const nlohmann::json& member(const nlohmann::json& object, const char* key);
/// A member's text; empty where there is none.
std::string text_of(const nlohmann::json& object, const char* key);
/// "/api/v1/KIND/ID" and what comes after it. The id may be a stranger's: it stays one part of the path.
std::string path_of(std::string_view kind, std::string_view id, std::string_view rest = {});

}  // namespace anchord::sync
