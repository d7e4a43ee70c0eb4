#include "server/storage/stores.hpp"

namespace anchord::sql {
namespace {

constexpr const char* k_token_insert =
    "INSERT INTO token (id, name, secret_sha256_hex, created_t_ns, expires_t_ns, revoked_t_ns, "
    "last_used_t_ns, bound, organization_id, requests_per_minute) "
    "VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)";
constexpr const char* k_insert_role = "INSERT INTO token_role (token_id, ordinal, role) VALUES (?1, ?2, ?3)";
constexpr const char* k_insert_site = "INSERT INTO token_site (token_id, site_id) VALUES (?1, ?2)";
constexpr const char* k_token_columns =
    "SELECT id, name, secret_sha256_hex, created_t_ns, expires_t_ns, revoked_t_ns, last_used_t_ns, bound, "
    "organization_id, requests_per_minute FROM token ";
constexpr const char* k_roles = "SELECT role FROM token_role WHERE token_id = ?1 ORDER BY ordinal";
constexpr const char* k_token_sites = "SELECT site_id FROM token_site WHERE token_id = ?1";
// A second revocation keeps the time of the first.
constexpr const char* k_revoke =
    "UPDATE token SET revoked_t_ns = coalesce(revoked_t_ns, ?2) WHERE id = ?1 RETURNING revoked_t_ns";
constexpr const char* k_touch = "UPDATE token SET last_used_t_ns = ?2 WHERE id = ?1 RETURNING last_used_t_ns";
constexpr const char* k_drop_sessions = "DELETE FROM browser_session WHERE until_t_ns <= ?1";
constexpr const char* k_insert_session =
    "INSERT INTO browser_session (cookie_sha256_hex, token_id, until_t_ns) VALUES (?1, ?2, ?3)";
constexpr const char* k_end_session = "DELETE FROM browser_session WHERE cookie_sha256_hex = ?1";
constexpr const char* k_sessions =
    "SELECT cookie_sha256_hex, token_id, until_t_ns FROM browser_session ORDER BY until_t_ns, "
    "cookie_sha256_hex";

Token read_token(Connection& c, Query& query) {
  Token token;
  token.id = query.id<TokenId>();
  token.name = query.text();
  token.secret_sha256_hex = query.text();
  token.created = query.time();
  token.expires = query.maybe_time();
  token.revoked = query.maybe_time();
  token.last_used = query.maybe_time();
  const bool bound = query.integer() != 0;
  token.organization = query.maybe([&] { return query.id<OrganizationId>(); });
  token.requests_per_minute = query.maybe([&] { return query.as<std::uint32_t>(); });
  Query roles(c, k_roles);
  roles << token.id;
  while (roles.step()) token.roles.push_back(roles.text());
  if (!bound) return token;
  std::vector<SiteId> ids;
  Query sites(c, k_token_sites);
  sites << token.id;
  while (sites.step()) ids.push_back(sites.id<SiteId>());
  token.sites = SiteSet::only(std::move(ids));
  return token;
}

class SqlTokenStore final : public TokenStore {
 public:
  explicit SqlTokenStore(Gate& gate) : gate_(gate) {}

  Result<void> insert(const Token& token) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      if (auto missing = missing_organization(c, token.organization)) return missing;
      Query query(c, k_token_insert);
      query << token.id << token.name << token.secret_sha256_hex << token.created << token.expires
            << token.revoked << token.last_used << (token.organization || !token.sites.all())
            << token.organization << std::optional<std::uint64_t>(token.requests_per_minute);
      query.run();
      std::int64_t ordinal = 0;
      for (const std::string& role : token.roles) {
        Query insert_role(c, k_insert_role);
        insert_role << token.id << ordinal++ << role;
        insert_role.run();
      }
      if (token.organization || token.sites.all()) return std::nullopt;
      for (const SiteId& site : *token.sites.sites()) {
        Query insert_site(c, k_insert_site);
        insert_site << token.id << site;
        insert_site.run();
      }
      return std::nullopt;
    });
  }
  Result<Token> token(const TokenId& id) override { return find("WHERE id = ?1", id); }
  Result<Token> token_by_secret(std::string_view secret_sha256_hex) override {
    return find("WHERE secret_sha256_hex = ?1", secret_sha256_hex);
  }
  Result<std::vector<Token>> tokens() override {
    return read_value<std::vector<Token>>(gate_, [&](Connection& c) -> Result<std::vector<Token>> {
      Query query(c, std::string(k_token_columns) + "ORDER BY id");
      std::vector<Token> found;
      while (query.step()) found.push_back(read_token(c, query));
      return found;
    });
  }
  Result<void> revoke(const TokenId& id, UtcTime now) override { return stamp(k_revoke, id, now); }
  Result<void> touch(const TokenId& id, UtcTime now) override { return stamp(k_touch, id, now); }
  Result<void> keep_session(const BrowserSession& session, UtcTime now) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query drop(c, k_drop_sessions);
      drop << now;
      drop.run();
      Query known(c, "SELECT bound FROM token WHERE id = ?1");
      known << session.token;
      if (!known.step()) return make_error(Errc::not_found, "no token " + to_string(session.token));
      Query query(c, k_insert_session);
      query << session.cookie_sha256_hex << session.token << session.until;
      query.run();
      return std::nullopt;
    });
  }
  Result<void> end_session(std::string_view cookie_sha256_hex) override {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, k_end_session);
      query << cookie_sha256_hex;
      query.run();
      return std::nullopt;
    });
  }
  Result<std::vector<BrowserSession>> sessions() override {
    using Sessions = std::vector<BrowserSession>;
    return read_value<Sessions>(gate_, [&](Connection& c) -> Result<Sessions> {
      Query query(c, k_sessions);
      Sessions found;
      while (query.step()) {
        auto cookie = query.text();
        const auto token = query.id<TokenId>();
        found.push_back({std::move(cookie), token, query.time()});
      }
      return found;
    });
  }

 private:
  template <class Key>
  Result<Token> find(const char* where, const Key& key) {
    return read_value<Token>(gate_, [&](Connection& c) -> Result<Token> {
      Query query(c, std::string(k_token_columns) + where);
      query << key;
      if (!query.step()) return make_error(Errc::not_found, "no such token");
      return read_token(c, query);
    });
  }
  Result<void> stamp(const char* text, const TokenId& id, UtcTime now) {
    return write_void(gate_, [&](Connection& c) -> std::optional<Error> {
      Query query(c, text);
      query << id << now;
      if (query.returned()) return std::nullopt;
      return make_error(Errc::not_found, "no token " + to_string(id));
    });
  }
  Gate& gate_;
};

}  // namespace

std::unique_ptr<TokenStore> make_token_store(Gate& gate) { return std::make_unique<SqlTokenStore>(gate); }

}  // namespace anchord::sql
