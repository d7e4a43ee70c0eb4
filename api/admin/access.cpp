#include "api/admin/access.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <utility>

#include "api/admin/secrets.hpp"
#include "api/kit/idempotency.hpp"
#include "api/kit/record_limits.hpp"
#include "core/base/line_text.hpp"
#include "core/base/locked.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

constexpr std::string_view k_prefix = "anc_";
constexpr std::size_t k_id_digits = 32;

std::string without_dashes(const Uuid& id) {
  std::string text = to_string(id);
  std::erase(text, '-');
  return text;
}

/// "anc_<32 hex>_<64 hex>" -> id text of 32 and secret; false for anything else.
bool split_token(std::string_view text, std::string& id, std::string_view& secret) {
  if (!text.starts_with(k_prefix) || text.size() != k_prefix.size() + k_id_digits + 1 + k_secret_digits)
    return false;
  id = text.substr(k_prefix.size(), k_id_digits);
  if (text[k_prefix.size() + k_id_digits] != '_') return false;
  secret = text.substr(k_prefix.size() + k_id_digits + 1);
  return true;
}

Principal principal_of(const Token& token) {
  Principal who{to_string(token.id), token.name, {}};
  for (const auto& word : token.roles) {
    if (const auto role = k_role_words.find(word)) who.roles.push_back(*role);
  }
  who.sites = token.sites;
  who.requests_per_minute = token.requests_per_minute;
  return who;
}

/// Errors: invalid_argument, saying what to do.
Result<void> check_bounds(const TokenBounds& bounds, const std::vector<std::string>& roles) {
  const bool whole = bounds.sites.all() && !bounds.organization;
  if (!bounds.sites.all() && bounds.organization)
    return make_error(Errc::invalid_argument,
                      "a token is bound to sites or to an organization: name one of the two");
  if (!bounds.requests_per_minute) return boost::outcome_v2::success();
  if (*bounds.requests_per_minute < 1 || *bounds.requests_per_minute > k_most_requests_per_minute)
    return make_error(Errc::invalid_argument,
                      "requests per minute must be 1.." + std::to_string(k_most_requests_per_minute));
  if (whole && std::ranges::find(roles, to_string(Role::admin)) != roles.end())
    return make_error(Errc::invalid_argument,
                      "an admin of the whole server has no limit of requests: leave it out, or bind the "
                      "token to sites or to an organization");
  return boost::outcome_v2::success();
}

struct Session {
  std::string token_id;  ///< key of the token cache
  SteadyTime until{};
  std::uint64_t order{};
};

struct Ticket {
  Login login;
  SteadyTime until{};
};

SteadyTime in(SteadyTime now, std::chrono::seconds time) {
  return later(now, std::chrono::nanoseconds(time).count());
}

/// Who may come in: asked with every request, changed seldom. No clock of its own, so that it is only data.
struct Admitted {
  std::map<std::string, Token, std::less<>> tokens;  ///< by the id's 32 digits
  /// When those that expire end, by the steady clock. Read off the system clock once, when a token is first
  /// seen: a step of it during a flight locks nobody out and brings nobody back.
  std::map<std::string, SteadyTime, std::less<>> ends;
  /// By SHA-256 of the cookie: a memory dump gives no login.
  std::map<std::string, Session, std::less<>> sessions;
  std::map<std::string, Ticket, std::less<>> tickets;  ///< by SHA-256 of the ticket
  std::uint64_t next_order{0};

  bool live(const std::string& key, const Token& token, SteadyTime now) const {
    if (token.revoked) return false;
    const auto end = ends.find(key);
    return end == ends.end() || now < end->second;
  }

  static std::string key_of(std::string_view token_id) {
    std::string key(token_id);
    std::erase(key, '-');
    return key;
  }

  bool holds(const Login& login, SteadyTime now) const {
    if (!login.session_sha256.empty()) {
      const auto session = sessions.find(login.session_sha256);
      if (session == sessions.end() || session->second.until <= now) return false;
    }
    const auto token = tokens.find(key_of(login.who.token_id));
    return token != tokens.end() && live(token->first, token->second, now) &&
           principal_of(token->second).roles == login.who.roles;
  }

  /// Null unless the secret is right and the token lives.
  const Token* find(std::string_view text, SteadyTime now) const {
    std::string id;
    std::string_view secret;
    if (!split_token(text, id, secret)) return nullptr;
    const auto at = tokens.find(id);
    // The comparison is done in any case, so that time does not tell which ids exist.
    const std::string expected = at == tokens.end() ? std::string(64, '0') : at->second.secret_sha256_hex;
    const bool same = equal_in_constant_time(sha256_hex(secret), expected);
    return at != tokens.end() && same && live(at->first, at->second, now) ? &at->second : nullptr;
  }
};

struct Refusal {
  UtcTime first{};
  std::string who, what, from;
  std::uint64_t count{};
};

/// What flush() writes: noted with every request, so apart from what all requests read together.
struct Notes {
  std::map<std::string, Refusal> refusals;
  std::uint64_t unnamed_refusals{0};
  std::map<std::string, UtcTime> used;  ///< by the id's 32 digits, since the last flush of them
  SteadyTime used_flushed{};
};

}  // namespace

struct AccessService::State {
  State(const Stores& s, const Clock& c, AccessOptions o)
      : organizations(s), store(s.tokens), log(s.access), clock(c), options(o) {}
  OrganizationIndex organizations;
  TokenStore& store;
  AccessStore& log;
  const Clock& clock;
  AccessOptions options;
  LoginGuard guard;
  Locked<Admitted, std::shared_mutex> admitted;  ///< never taken together with notes
  mutable Locked<Notes> notes;

  /// To the sites of its organization, which the store does not know of a token.
  void bind(Token& token) {
    if (token.organization) token.sites = SiteSet::of(organizations.sites_of(*token.organization));
  }
  SteadyTime steady_now() const { return options.steady->now(); }
  void note_end(Admitted& all, const std::string& key, const Token& token) const {
    if (token.expires) all.ends.try_emplace(key, later(steady_now(), token.expires->ns - clock.now().ns));
  }
  /// A store that cannot write says so by its health; who signs in while the disk is full is let in all the
  /// same.
  void keep(BrowserSession& session, const std::string& pushed_out) const {
    const UtcTime now = clock.now();
    session.until = UtcTime{now.ns + std::chrono::nanoseconds(options.session_lifetime).count()};
    if (!pushed_out.empty()) (void)store.end_session(pushed_out).has_value();
    (void)store.keep_session(session, now).has_value();
  }
  /// A clock that stood elsewhere at its login gives a session no more than its lifetime.
  void let_in_again(Admitted& all, const BrowserSession& kept) const {
    const auto left = std::chrono::nanoseconds(kept.until.ns - clock.now().ns);
    if (left.count() <= 0) return;
    const auto most = std::min<std::chrono::nanoseconds>(left, options.session_lifetime);
    all.sessions.try_emplace(
        kept.cookie_sha256_hex,
        Session{without_dashes(kept.token.uuid), later(steady_now(), most.count()), all.next_order++});
  }
  void note_use(const std::string& key) const {
    auto noted = notes.lock();
    noted->used[key] = clock.now();
  }
};

AccessService::AccessService(const Stores& stores, const Clock& clock, AccessOptions options)
    : state_(std::make_unique<State>(stores, clock, options)) {}
AccessService::~AccessService() { flush(); }

const AccessOptions& AccessService::options() const { return state_->options; }

OrganizationIndex& AccessService::organizations() { return state_->organizations; }

Result<void> AccessService::load() {
  BOOST_OUTCOME_TRYV(state_->organizations.load());
  BOOST_OUTCOME_TRY(auto all, state_->store.tokens());
  BOOST_OUTCOME_TRY(auto sessions, state_->store.sessions());
  for (auto& token : all) state_->bind(token);
  auto admitted = state_->admitted.lock();
  admitted->tokens.clear();
  for (auto& token : all) {
    const std::string key = without_dashes(token.id.uuid);
    state_->note_end(*admitted, key, token);
    admitted->tokens.emplace(key, std::move(token));
  }
  for (const auto& kept : sessions) state_->let_in_again(*admitted, kept);
  return boost::outcome_v2::success();
}

bool AccessService::has_tokens() const {
  const SteadyTime now = state_->steady_now();
  const auto admitted = state_->admitted.lock_shared();
  return std::ranges::any_of(
      admitted->tokens, [&](const auto& entry) { return admitted->live(entry.first, entry.second, now); });
}

Result<NewToken> AccessService::create_token(std::string_view name, const std::vector<std::string>& roles,
                                             std::optional<UtcTime> expires, const Principal& by,
                                             std::string_view from, const TokenBounds& bounds) {
  if (is_blank(name)) return make_error(Errc::invalid_argument, "the name must not be empty");
  if (const auto fault = line_fault(name, record_limits::k_token_name); fault != LineFault::none)
    return make_error(Errc::invalid_argument, "the name " + in_words(fault, record_limits::k_token_name));
  if (roles.empty()) return make_error(Errc::invalid_argument, "a token needs at least one role");
  for (const auto& word : roles) {
    BOOST_OUTCOME_TRYV(k_role_words.parse("role", word));
  }
  const UtcTime now = state_->clock.now();
  if (expires && *expires <= now) return make_error(Errc::invalid_argument, "the expiry is in the past");
  BOOST_OUTCOME_TRYV(check_bounds(bounds, roles));
  const std::string secret = random_hex_256();
  NewToken made;
  made.token.id = TokenId{make_uuid_v7(now)};
  made.token.name = std::string(name);
  made.token.secret_sha256_hex = sha256_hex(secret);
  made.token.roles = roles;
  made.token.created = now;
  made.token.expires = expires;
  made.token.sites = bounds.sites;
  made.token.organization = bounds.organization;
  made.token.requests_per_minute = bounds.requests_per_minute;
  const std::string key = without_dashes(made.token.id.uuid);
  made.text = std::string(k_prefix) + key + "_" + secret;
  BOOST_OUTCOME_TRYV(state_->store.insert(made.token));
  state_->bind(made.token);
  {
    auto admitted = state_->admitted.lock();
    state_->note_end(*admitted, key, made.token);
    admitted->tokens.emplace(key, made.token);
  }
  audit(by.token_id, "token create " + to_string(made.token.id), from, "done");
  return made;
}

Result<void> AccessService::revoke_token(const TokenId& id, const Principal& by, std::string_view from) {
  const UtcTime now = state_->clock.now();
  BOOST_OUTCOME_TRYV(state_->store.revoke(id, now));
  {
    auto admitted = state_->admitted.lock();
    const auto at = admitted->tokens.find(without_dashes(id.uuid));
    if (at != admitted->tokens.end() && !at->second.revoked) at->second.revoked = now;
  }
  audit(by.token_id, "token revoke " + to_string(id), from, "done");
  return boost::outcome_v2::success();
}

std::vector<Token> AccessService::tokens() const {
  std::vector<Token> all;
  {
    const auto admitted = state_->admitted.lock_shared();
    for (const auto& [key, token] : admitted->tokens) all.push_back(token);
  }
  const auto notes = state_->notes.lock();
  for (auto& token : all) {
    const auto at = notes->used.find(without_dashes(token.id.uuid));
    if (at != notes->used.end()) token.last_used = at->second;
  }
  return all;
}

std::optional<Principal> AccessService::verify(std::string_view token_text) const {
  std::string key;
  Principal who;
  {
    const SteadyTime now = state_->steady_now();
    const auto admitted = state_->admitted.lock_shared();
    const Token* token = admitted->find(token_text, now);
    if (token == nullptr) return std::nullopt;
    key = without_dashes(token->id.uuid);
    who = principal_of(*token);
  }
  state_->note_use(key);
  return who;
}

Result<std::string> AccessService::open_session(std::string_view token_text, std::string_view from) {
  const std::string cookie = random_hex_256();
  std::string who, pushed_out;
  BrowserSession kept{sha256_hex(cookie), {}, {}};
  {
    const SteadyTime now = state_->steady_now();
    auto admitted = state_->admitted.lock();
    if (const Token* token = admitted->find(token_text, now)) {
      auto& sessions = admitted->sessions;
      who = to_string(token->id);
      std::erase_if(sessions, [&](const auto& entry) { return entry.second.until <= now; });
      if (sessions.size() >= state_->options.max_sessions) {
        const auto oldest =
            std::ranges::min_element(sessions, {}, [](const auto& entry) { return entry.second.order; });
        pushed_out = oldest->first;
        sessions.erase(oldest);
      }
      kept.token = token->id;
      sessions[kept.cookie_sha256_hex] = {without_dashes(token->id.uuid),
                                          in(now, state_->options.session_lifetime), admitted->next_order++};
    }
  }
  if (!who.empty()) state_->keep(kept, pushed_out);
  audit(who.empty() ? "nobody" : who, "login", from, who.empty() ? "refused" : "done");
  if (who.empty()) return make_error(Errc::invalid_argument, "this token is unknown, expired or revoked");
  return cookie;
}

void AccessService::close_session(std::string_view cookie, std::string_view from) {
  std::string who;
  {
    auto admitted = state_->admitted.lock();
    const auto at = admitted->sessions.find(sha256_hex(cookie));
    if (at == admitted->sessions.end()) return;
    who = at->second.token_id;
    admitted->sessions.erase(at);
  }
  (void)state_->store.end_session(sha256_hex(cookie)).has_value();
  audit(who, "logout", from, "done");
}

std::optional<Principal> AccessService::session(std::string_view cookie) const {
  if (cookie.size() != k_secret_digits) return std::nullopt;
  std::string key;
  Principal who;
  {
    const SteadyTime now = state_->steady_now();
    const auto admitted = state_->admitted.lock_shared();
    const auto at = admitted->sessions.find(sha256_hex(cookie));
    if (at == admitted->sessions.end() || at->second.until <= now) return std::nullopt;
    const auto token = admitted->tokens.find(at->second.token_id);
    if (token == admitted->tokens.end() || !admitted->live(token->first, token->second, now))
      return std::nullopt;
    key = token->first;
    who = principal_of(token->second);
  }
  state_->note_use(key);
  return who;
}

Login AccessService::login_of(const Principal& who, std::string_view cookie) const {
  return {who, cookie.empty() ? std::string{} : sha256_hex(cookie)};
}

bool AccessService::holds(const Login& login) const {
  if (state_->options.auth_off) return true;
  const SteadyTime now = state_->steady_now();
  const auto admitted = state_->admitted.lock_shared();
  return admitted->holds(login, now);
}

bool AccessService::ended(std::string_view token_id) const {
  const SteadyTime now = state_->steady_now();
  const auto admitted = state_->admitted.lock_shared();
  const auto token = admitted->tokens.find(Admitted::key_of(token_id));
  return token != admitted->tokens.end() && !admitted->live(token->first, token->second, now);
}

LoginGuard& AccessService::guard() { return state_->guard; }

std::string AccessService::make_ticket(Login login) {
  const std::string ticket = random_hex_256();
  const SteadyTime now = state_->steady_now();
  auto admitted = state_->admitted.lock();
  auto& tickets = admitted->tickets;
  std::erase_if(tickets, [&](const auto& entry) { return entry.second.until <= now; });
  if (tickets.size() >= state_->options.max_tickets) tickets.erase(tickets.begin());
  tickets[sha256_hex(ticket)] = {std::move(login), in(now, state_->options.ticket_lifetime)};
  return ticket;
}

std::optional<Login> AccessService::take_ticket(std::string_view ticket) {
  if (ticket.size() != k_secret_digits) return std::nullopt;
  const SteadyTime now = state_->steady_now();
  auto admitted = state_->admitted.lock();
  const auto at = admitted->tickets.find(sha256_hex(ticket));
  if (at == admitted->tickets.end()) return std::nullopt;
  Ticket found = std::move(at->second);
  admitted->tickets.erase(at);
  if (found.until <= now || !admitted->holds(found.login, now)) return std::nullopt;
  return std::move(found.login);
}

void AccessService::note_refusal(std::string_view who, std::string_view what, std::string_view from) {
  constexpr std::size_t k_max_noted = 1000;
  const std::string key = std::string(who) + '\n' + std::string(what) + '\n' + std::string(from);
  auto notes = state_->notes.lock();
  const auto at = notes->refusals.find(key);
  if (at == notes->refusals.end() && notes->refusals.size() >= k_max_noted) {
    ++notes->unnamed_refusals;
    return;
  }
  auto& refusal = notes->refusals[key];
  if (refusal.count++ == 0)
    refusal = {state_->clock.now(), std::string(who), std::string(what), std::string(from), 1};
}

void AccessService::flush() {
  constexpr std::int64_t k_minute_ns = 60'000'000'000;
  std::map<std::string, Refusal> refusals;
  std::map<std::string, UtcTime> used;
  std::uint64_t unnamed = 0;
  const UtcTime now = state_->clock.now();
  {
    const SteadyTime steady = state_->steady_now();
    auto notes = state_->notes.lock();
    refusals.swap(notes->refusals);
    unnamed = std::exchange(notes->unnamed_refusals, 0);
    if (steady.ns - notes->used_flushed.ns >= k_minute_ns) {
      used.swap(notes->used);
      notes->used_flushed = steady;
    }
  }
  const auto write = [&](const Refusal& refusal) {
    const std::string result =
        refusal.count == 1 ? "refused" : "refused " + std::to_string(refusal.count) + " times";
    // A store in trouble tells it by its health; a refusal that is not logged was refused all the same.
    return state_->log.append_audit({refusal.first, refusal.who, refusal.what, refusal.from, result})
        .has_value();
  };
  for (const auto& [key, refusal] : refusals) (void)write(refusal);
  if (unnamed > 0) (void)write({now, "others", "requests", "", unnamed});
  for (const auto& [key, time] : used) {
    std::optional<TokenId> id;
    {
      auto admitted = state_->admitted.lock();
      const auto at = admitted->tokens.find(key);
      if (at == admitted->tokens.end()) continue;
      at->second.last_used = time;
      id = at->second.id;
    }
    (void)state_->store.touch(*id, time).has_value();
  }
}

void AccessService::audit(std::string_view who, std::string_view what, std::string_view from,
                          std::string_view result) {
  const AuditEntry entry{state_->clock.now(), std::string(who), std::string(what), std::string(from),
                         std::string(result)};
  // A store that cannot write says so through its health and refuses the change itself.
  if (auto written = state_->log.append_audit(entry); !written) return;
}

Principal local_principal() { return {"local", "local", {Role::admin}}; }

std::string_view cookie_value(std::string_view cookie_header, std::string_view name) {
  while (!cookie_header.empty()) {
    const auto end = std::min(cookie_header.find(';'), cookie_header.size());
    std::string_view pair = cookie_header.substr(0, end);
    while (!pair.empty() && pair.front() == ' ') pair.remove_prefix(1);
    if (pair.size() > name.size() && pair.starts_with(name) && pair[name.size()] == '=') {
      return pair.substr(name.size() + 1);
    }
    cookie_header.remove_prefix(std::min(end + 1, cookie_header.size()));
  }
  return {};
}

}  // namespace anchord::api
