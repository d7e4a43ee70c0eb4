#include "api/admin/routes.hpp"

#include <nlohmann/json.hpp>

#include "api/admin/access.hpp"
#include "api/kit/problem.hpp"
#include "api/kit/reader.hpp"
#include "api/kit/record_limits.hpp"
#include "api/kit/router.hpp"
#include "api/kit/support.hpp"
#include "core/base/to_wire.hpp"
#include "core/ports/organization_store.hpp"
#include "core/ports/site_store.hpp"

namespace anchord::api {
namespace {

using nlohmann::json;

constexpr std::size_t k_max_sites = 100;  ///< of a token

/// The body as an object with no other keys than these; every fault at once.
json body_of(const Request& request, std::initializer_list<std::string_view> known) {
  const json body = request.body.empty() ? json::object() : json::parse(request.body, nullptr, false);
  if (body.is_discarded()) throw_problem(400, "malformed", "the body is not JSON");
  std::vector<FieldError> faults;
  if (!body.is_object()) throw_problem(422, "validation", "the body must be an object");
  for (const auto& [key, value] : body.items()) {
    if (std::ranges::find(known, key) == known.end())
      faults.push_back({"/" + key, "unknown", "no such field"});
  }
  if (!faults.empty()) throw_problem(422, "validation", "unknown fields", faults);
  return body;
}

std::string text_field(const json& body, const char* key, std::vector<FieldError>& faults) {
  const auto at = body.find(key);
  if (at == body.end()) {
    faults.push_back({std::string("/") + key, "required", std::string(key) + " is missing"});
    return {};
  }
  if (!at->is_string()) {
    faults.push_back({std::string("/") + key, "type", "must be a string"});
    return {};
  }
  return at->get<std::string>();
}

/// null: every site.
json sites_json(const SiteSet& sites) {
  if (sites.all()) return nullptr;
  json out = json::array();
  for (const auto& id : *sites.sites()) out.push_back(to_string(id));
  return out;
}

template <class T>
json id_or_null(const std::optional<T>& id) {
  return id ? json(to_string(*id)) : json(nullptr);
}

json number_or_null(const std::optional<std::uint32_t>& number) {
  return number ? json(*number) : json(nullptr);
}

json token_json(const Token& token) {
  json out{{"id", to_string(token.id)},
           {"name", token.name},
           {"roles", token.roles},
           {"sites", sites_json(token.sites)},
           {"organization", id_or_null(token.organization)},
           {"requests_per_minute", number_or_null(token.requests_per_minute)},
           {"created_at", to_rfc3339(token.created)}};
  const auto time = [](const std::optional<UtcTime>& t) { return t ? json(to_rfc3339(*t)) : json(nullptr); };
  out["expires_at"] = time(token.expires);
  out["revoked_at"] = time(token.revoked);
  out["last_used_at"] = time(token.last_used);
  return out;
}

json principal_json(const Principal& who) {
  json roles = json::array();
  for (const Role role : who.roles) roles.push_back(to_string(role));
  const bool login_is_off = who.token_id == local_principal().token_id;
  return {{"token_id", who.token_id},
          {"name", who.name},
          {"roles", roles},
          {"sites", sites_json(who.sites)},
          {"organization", id_or_null(who.sites.organization())},
          {"requests_per_minute", number_or_null(who.requests_per_minute)},
          {"auth", login_is_off ? "off" : "on"}};
}

Response answer(int status, const json& body) {
  Response response;
  response.status = status;
  response.header("Content-Type", "application/json").header("Cache-Control", "no-store");
  response.body = to_wire(body);
  return response;
}

// The page and the API are the same origin; without TLS a Secure cookie would never be sent back. Whether
// there is TLS, here or at a trusted proxy, is in this header: the transport lets nobody else write it.
std::string cookie(const Request& request, std::string_view value, std::int64_t max_age_s) {
  const bool tls = request.header("x-forwarded-proto") == "https";
  return std::string(k_session_cookie) + "=" + std::string(value) +
         "; Path=/; HttpOnly; SameSite=Strict; Max-Age=" + std::to_string(max_age_s) +
         (tls ? "; Secure" : "");
}

/// Of the session that asks; a token in the header goes before a cookie, as at the door.
std::string_view cookie_of(const Request& request) {
  if (!request.header("authorization").empty()) return {};
  return cookie_value(request.header("cookie"), k_session_cookie);
}

/// Absent or null: every site.
SiteSet read_sites(const json& body, SiteStore& known, std::vector<FieldError>& faults) {
  const auto list = body.find("sites");
  if (list == body.end() || list->is_null()) return {};
  if (!list->is_array() || list->empty() || list->size() > k_max_sites) {
    faults.push_back(
        {"/sites", "wrong_type", "null, or a list of 1 to " + std::to_string(k_max_sites) + " ids of sites"});
    return {};
  }
  std::vector<SiteId> sites;
  for (std::size_t i = 0; i < list->size(); ++i) {
    const auto& item = (*list)[i];
    const std::string at = "/sites/" + std::to_string(i);
    const auto id = parse_uuid(item.is_string() ? item.get_ref<const std::string&>() : "");
    if (!id)
      faults.push_back({at, "bad_id", id.error().message});
    else if (!known.site(SiteId{id.value()}))
      faults.push_back({at, "unknown_site", "there is no such site"});
    else
      sites.push_back(SiteId{id.value()});
  }
  return SiteSet::only(std::move(sites));
}

/// Absent or null: none.
std::optional<OrganizationId> read_organization(const json& body, OrganizationStore& known,
                                                std::vector<FieldError>& faults) {
  const auto at = body.find("organization");
  if (at == body.end() || at->is_null()) return std::nullopt;
  const auto id = parse_uuid(at->is_string() ? at->get_ref<const std::string&>() : "");
  if (!id)
    faults.push_back({"/organization", "bad_id", id.error().message});
  else if (!known.organization(OrganizationId{id.value()}))
    faults.push_back({"/organization", "unknown_organization",
                      "there is no such organization; the ids are in GET /api/v1/organizations"});
  else if (const auto sites = body.find("sites"); sites != body.end() && !sites->is_null())
    faults.push_back({"/organization", "conflict",
                      "a token is bound to sites or to an organization: leave one of the two out"});
  else
    return OrganizationId{id.value()};
  return std::nullopt;
}

/// Absent or null: no limit.
std::optional<std::uint32_t> read_requests(const json& body, std::vector<FieldError>& faults) {
  const auto at = body.find("requests_per_minute");
  if (at == body.end() || at->is_null()) return std::nullopt;
  const auto number = at->is_number_unsigned() ? at->get<std::uint64_t>() : 0;
  if (number >= 1 && number <= k_most_requests_per_minute) return static_cast<std::uint32_t>(number);
  faults.push_back({"/requests_per_minute", "out_of_range",
                    "null, or a number of 1 to " + std::to_string(k_most_requests_per_minute)});
  return std::nullopt;
}

Response create_token(AccessService& access, SiteStore& known, OrganizationStore& organizations,
                      const Request& request) {
  const json body =
      body_of(request, {"name", "roles", "expires_at", "sites", "organization", "requests_per_minute"});
  std::vector<FieldError> faults;
  const std::string name =
      Fields(body, "", faults).text("name", record_limits::k_token_name, true).value_or("");
  std::vector<std::string> roles;
  const auto list = body.find("roles");
  if (list == body.end() || !list->is_array() || list->empty()) {
    faults.push_back({"/roles", "required", "a list of at least one role"});
  } else {
    for (std::size_t i = 0; i < list->size(); ++i) {
      const auto& word = (*list)[i];
      if (!word.is_string() || !k_role_words.find(word.get<std::string>())) {
        faults.push_back({"/roles/" + std::to_string(i), "unknown",
                          "viewer, integrator, gateway, engineer, operator or admin"});
      } else {
        roles.push_back(word.get<std::string>());
      }
    }
  }
  std::optional<UtcTime> expires;
  if (const auto at = body.find("expires_at"); at != body.end() && !at->is_null()) {
    const auto time = at->is_string() ? parse_rfc3339(at->get<std::string>()) : parse_rfc3339("");
    if (time) {
      expires = time.value();
    } else {
      faults.push_back({"/expires_at", "format", "a UTC time like 2027-01-31T00:00:00Z"});
    }
  }
  TokenBounds bounds;
  bounds.sites = read_sites(body, known, faults);
  bounds.organization = read_organization(body, organizations, faults);
  bounds.requests_per_minute = read_requests(body, faults);
  refuse_if_any(faults);
  const auto made =
      value_or_problem(access.create_token(name, roles, expires, request.principal, request.remote, bounds));
  json out = token_json(made.token);
  out["token"] = made.text;  // the only time it is shown
  auto response = answer(201, out);
  return response.header("Location", "/api/v1/tokens/" + to_string(made.token.id));
}

Response list_tokens(AccessService& access, const Request& request) {
  check_query(request, {});
  json items = json::array();
  for (const auto& token : access.tokens()) items.push_back(token_json(token));
  return answer(200, {{"items", items}, {"next_cursor", nullptr}});
}

Response revoke_token(AccessService& access, const Request& request) {
  const auto id = parse_uuid(request.params.at("id"));
  if (!id) throw_problem(404, "not-found", "no such token");
  value_or_problem(access.revoke_token(TokenId{id.value()}, request.principal, request.remote));
  Response response;
  response.status = 204;
  return response;
}

Response login(AccessService& access, const Request& request) {
  const json body = body_of(request, {"token"});
  std::vector<FieldError> faults;
  const std::string token = text_field(body, "token", faults);
  if (!faults.empty()) throw_problem(422, "validation", "token is missing", faults);
  const auto opened = access.open_session(token, request.remote);
  if (!opened) {
    if (const auto wait_s = access.guard().failed(token, request.remote, LoginGuard::Clock::now())) {
      auto response = problem(429, "rate-limited",
                              "too many wrong tokens from " + request.remote + "; wait " +
                                  std::to_string(*wait_s) + " s (a valid one is accepted at once)");
      throw ProblemException{std::move(response.header("Retry-After", std::to_string(*wait_s)))};
    }
    throw_problem(401, "unauthorized", opened.error().message);
  }
  const auto who = access.session(opened.value());
  auto response = answer(200, who ? principal_json(*who) : json::object());
  return response.header("Set-Cookie",
                         cookie(request, opened.value(), access.options().session_lifetime.count()));
}

Response logout(AccessService& access, const Request& request) {
  access.close_session(cookie_value(request.header("cookie"), k_session_cookie), request.remote);
  Response response;
  response.status = 204;
  return response.header("Set-Cookie", cookie(request, "", 0));
}

}  // namespace

void add_access_routes(Router& router, AccessService& access, SiteStore& sites,
                       OrganizationStore& organizations) {
  using enum Method;
  const auto admin = Access::any_of({Role::admin});
  router.add({get, "/api/v1/tokens", admin, [&access](const Request& r) { return list_tokens(access, r); }});
  router.add(
      keeps_nothing({post, "/api/v1/tokens", admin, [&access, &sites, &organizations](const Request& r) {
                       return create_token(access, sites, organizations, r);
                     }}));
  router.add(
      {del, "/api/v1/tokens/{id}", admin, [&access](const Request& r) { return revoke_token(access, r); }});
  router.add(keeps_nothing({post, "/api/v1/session", Access::open(),
                            [&access](const Request& r) { return login(access, r); }, 4096}));
  router.add(
      {del, "/api/v1/session", Access::open(), [&access](const Request& r) { return logout(access, r); }});
  router.add({get, "/api/v1/me", Access::any_token(),
              [](const Request& r) { return answer(200, principal_json(r.principal)); }});
  router.add(keeps_nothing(
      {post, "/api/v1/ws-tickets", Access::any_token(), [&access](const Request& r) {
         return answer(201, {{"ticket", access.make_ticket(access.login_of(r.principal, cookie_of(r)))},
                             {"expires_in_s", access.options().ticket_lifetime.count()}});
       }}));
}

}  // namespace anchord::api
