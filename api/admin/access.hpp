#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/admin/login_guard.hpp"
#include "api/kit/message.hpp"
#include "api/kit/organization_index.hpp"
#include "core/base/result.hpp"
#include "core/base/steady.hpp"
#include "core/base/time.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/token_store.hpp"

namespace anchord::api {

struct AccessOptions {
  std::chrono::seconds ticket_lifetime{30};          ///< a WebSocket ticket, single use
  std::chrono::seconds session_lifetime{12 * 3600};  ///< a browser login: one working day
  std::size_t max_sessions{1000};                    ///< oldest login leaves first
  std::size_t max_tickets{1000};
  const SteadyClock* steady{&system_steady_clock()};  ///< what sessions, tickets and expiry run on
  bool auth_off{false};  ///< demonstration on loopback: everybody is `local`, with every right
};

/// What a new token is bound to: every site, `sites`, or those that an organization has now and later.
struct TokenBounds {
  SiteSet sites{};
  std::optional<OrganizationId> organization{};
  std::optional<std::uint32_t> requests_per_minute{};
};
/// Requests of a token, and of all tokens of an organization.
inline constexpr std::uint32_t k_most_requests_per_minute = 1'000'000;

/// A token as shown once to the person who asked for it; only its hash is kept.
struct NewToken {
  Token token;
  std::string text;  ///< anc_<id>_<secret>
};

/// By what somebody came in; what it opens (streams, uploads) ends with it.
struct Login {
  Principal who;
  std::string session_sha256{};  ///< of the browser session; empty: by a token
};

/// Who may come in: tokens, browser sessions and WebSocket tickets.
///
/// Tokens live in the store and, all of them, in a cache here, so that verify() never touches the disk.
/// Secrets are 256 random bits of OpenSSL's generator, kept as SHA-256 and compared in constant time (a fast
/// hash is right for random secrets: nothing can be guessed). Sessions are in the store too, so that nobody
/// is signed out when the server starts again in a flight; one that the store could not take, and every
/// ticket, ends with the process. Thread-safe.
class AccessService {
 public:
  AccessService(const Stores& stores, const Clock& clock, AccessOptions options = {});
  ~AccessService();
  AccessService(const AccessService&) = delete;
  AccessService& operator=(const AccessService&) = delete;

  /// Reads every token, session and organization. Call before the first verify().
  Result<void> load();
  OrganizationIndex& organizations();
  bool has_tokens() const;
  const AccessOptions& options() const;

  /// Roles must be known words ("viewer", ... "admin"). Sites are not asked for here: whoever knows them
  /// does. Errors: invalid_argument, those of the store (not_found: no such organization).
  Result<NewToken> create_token(std::string_view name, const std::vector<std::string>& roles,
                                std::optional<UtcTime> expires, const Principal& by, std::string_view from,
                                const TokenBounds& bounds = {});
  Result<void> revoke_token(const TokenId& id, const Principal& by, std::string_view from);
  std::vector<Token> tokens() const;

  /// Null for anything that is not a live token.
  std::optional<Principal> verify(std::string_view token_text) const;
  /// Slows those who guess; asked after verify(), so that what is right is never refused.
  LoginGuard& guard();

  /// Login of a browser: the cookie's value. Audited, also when refused.
  Result<std::string> open_session(std::string_view token_text, std::string_view from);
  void close_session(std::string_view cookie, std::string_view from);
  /// Null when unknown, too old, or its token was revoked or has expired since.
  std::optional<Principal> session(std::string_view cookie) const;

  /// `cookie`: of the browser session that asks; empty: it is a token.
  Login login_of(const Principal& who, std::string_view cookie) const;
  /// Does it still open what it opened? False once its token was revoked or has expired, its roles are
  /// others, or its session has ended. Never waits: for every tick of every stream.
  bool holds(const Login& login) const;
  /// Was this token revoked, or has it expired? False for one that is not known. Never waits.
  bool ended(std::string_view token_id) const;

  std::string make_ticket(Login login);
  /// The login the ticket was made for, once, and only while that holds.
  std::optional<Login> take_ticket(std::string_view ticket);

  /// Notes a request that was refused for who sent it; flush() writes it. Never waits: for the io thread.
  /// Equal ones are counted, beyond 1000 different ones between two flushes only their number is kept.
  void note_refusal(std::string_view who, std::string_view what, std::string_view from);
  /// Writes what was noted: refusals to the audit log, each token's time of last use to the store (at most
  /// once a minute). May wait for the disk.
  void flush();

  /// Appends to the audit log; a log that cannot be written is reported by the store's health, not here.
  void audit(std::string_view who, std::string_view what, std::string_view from, std::string_view result);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// "viewer" -> Role::viewer; null for other words. `operator` is Role::op.
/// The principal of --auth=off.
Principal local_principal();
/// Name of the session cookie.
inline constexpr std::string_view k_session_cookie = "anchord_session";
/// Value of one cookie of a Cookie header; empty when absent.
std::string_view cookie_value(std::string_view cookie_header, std::string_view name);

}  // namespace anchord::api
