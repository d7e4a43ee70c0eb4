#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/organization_id.hpp"
#include "core/base/result.hpp"
#include "core/base/site_set.hpp"
#include "core/base/time.hpp"

namespace anchord {

/// Access tokens: only the hash of the secret is stored.
struct Token {
  TokenId id{};
  std::string name;
  std::string secret_sha256_hex;
  std::vector<std::string> roles;
  UtcTime created{};
  std::optional<UtcTime> expires{}, revoked{}, last_used{};
  SiteSet sites{};  ///< what it is bound to; as stored, none where it is bound to an organization
  std::optional<OrganizationId> organization{};  ///< to whose sites, those of later too, it is bound instead
  std::optional<std::uint32_t> requests_per_minute{};  ///< at most; nothing: no limit of its own
};

/// A browser that was let in by a token; only the hash of its cookie is stored.
struct BrowserSession {
  std::string cookie_sha256_hex;
  TokenId token{};
  UtcTime until{};
};

class TokenStore {
 public:
  virtual ~TokenStore() = default;
  /// errors: not_found where its organization is not there, conflict
  virtual Result<void> insert(const Token& token) = 0;
  virtual Result<Token> token(const TokenId& id) = 0;
  virtual Result<Token> token_by_secret(std::string_view secret_sha256_hex) = 0;
  virtual Result<std::vector<Token>> tokens() = 0;
  virtual Result<void> touch(const TokenId& id,
                             UtcTime now) = 0;  ///< last used; call it at most once a minute
  virtual Result<void> revoke(const TokenId& id, UtcTime now) = 0;
  /// Those whose time has passed `now` leave. errors: not_found where its token is not there, conflict
  virtual Result<void> keep_session(const BrowserSession& session, UtcTime now) = 0;
  /// Also where it is not there.
  virtual Result<void> end_session(std::string_view cookie_sha256_hex) = 0;
  virtual Result<std::vector<BrowserSession>> sessions() = 0;  ///< the one that ends first comes first
};

}  // namespace anchord
