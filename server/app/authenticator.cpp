#include "server/app/authenticator.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "api/kit/problem.hpp"
#include "core/base/base64.hpp"
#include "server/app/live_peer.hpp"
#include "server/http/request_check.hpp"
#include "server/http/static_files.hpp"
#include "server/http/text.hpp"
#include "server/runtime/logging.hpp"

namespace anchord::server {
namespace {

constexpr std::string_view k_live_path = "/api/v1/ws";
constexpr std::string_view k_omlox_path = "/omlox/v2/ws/socket";
/// Connections that have ten seconds for their token: of all, and of one address.
constexpr WsPlaceLimits k_strangers{8, 4, 0};
constexpr std::string_view k_subprotocol = "anchord.v1";
/// In the audit log.
constexpr std::string_view k_unknown_token = "a token that is unknown, expired or revoked";

bool unsafe(api::Method method) {
  return method != api::Method::get && method != api::Method::head && method != api::Method::options;
}

/// What a plain HTML form can send without asking anybody.
bool form_type(std::string_view content_type) {
  return content_type.empty() || content_type.starts_with("application/x-www-form-urlencoded") ||
         content_type.starts_with("multipart/form-data") || content_type.starts_with("text/plain");
}

/// From a loopback address, and not by way of a proxy that speaks for somebody else.
bool from_this_machine(const api::Request& request) {
  const bool loopback = request.remote.starts_with("127.") || request.remote == "::1";
  return loopback && request.header("forwarded").empty() && request.header("x-forwarded-for").empty() &&
         request.header("x-forwarded-host").empty() && request.header("via").empty();
}

bool has_body(const api::Request& request) {
  return !request.header("transfer-encoding").empty() ||
         (!request.header("content-length").empty() && request.header("content-length") != "0");
}

Admission refused(api::Response response, std::string route = {}) {
  Admission admission;
  admission.refusal = std::move(response);
  admission.route = std::move(route);
  return admission;
}

/// Token of "Bearer x", or of the password of "Basic x".
std::string credential(std::string_view authorization) {
  const auto space = authorization.find(' ');
  if (space == std::string_view::npos) return {};
  const auto scheme = authorization.substr(0, space);
  const auto rest = trim(authorization.substr(space + 1));
  if (iequals(scheme, "bearer")) return std::string(rest);
  if (!iequals(scheme, "basic")) return {};
  const auto decoded = from_base64(rest);
  if (!decoded) return {};
  const auto colon = decoded->find(':');
  return colon == std::string::npos ? std::string{} : decoded->substr(colon + 1);
}

/// What no quota of requests refuses: measurements and flights that come in, what keeps an aircraft safe, and
/// the live picture of who flies it. All of it has limits of its own.
bool needed_in_flight(const api::Request& request, const api::Resolution& found) {
  if (request.path == k_live_path) return true;
  if (found.kind != api::Resolution::Kind::matched) return false;
  const api::Route& route = *found.route;
  return route.streams_body || route.keeps == api::Keeps::always || route.work == api::Work::command ||
         route.work == api::Work::flight || route.pattern.starts_with("/api/v1/bundles");
}

/// Instead of what every refusal of its status says.
void retry_after(api::Response& response, int wait_s) {
  std::erase_if(response.headers, [](const auto& header) { return header.first == "Retry-After"; });
  response.header("Retry-After", std::to_string(wait_s));
}

/// 429 with what was asked too often (IETF draft-ietf-httpapi-ratelimit-headers-10).
api::Response too_many(std::string detail, const std::string& policy, const Rate& rate, int wait_s) {
  auto response = api::problem(429, "rate-limited", std::move(detail));
  const auto whole = [](double n) { return std::to_string(std::max(1L, std::lround(n))); };
  retry_after(response, wait_s);
  response
      .header("RateLimit-Policy",
              '"' + policy + "\";q=" + whole(rate.burst) + ";w=" + whole(rate.burst / rate.per_s))
      .header("RateLimit", '"' + policy + "\";r=0;t=" + std::to_string(wait_s));
  return response;
}

}  // namespace

Authenticator::Authenticator(const api::Router& router, api::WsHandlerFactory live, api::TokenWsFactory omlox,
                             api::AccessService& access, Metrics& metrics, AuthenticatorOptions options)
    : router_(router),
      live_(std::move(live)),
      omlox_(std::move(omlox)),
      access_(access),
      metrics_(metrics),
      options_(std::move(options)),
      places_(options_.places),
      strangers_(k_strangers) {}

/// Whoever guesses is told to wait; whoever has the right secret never comes here.
api::Response Authenticator::wrong_secret(const api::Request& request, std::string_view secret,
                                          std::string_view what) {
  const auto wait_s = access_.guard().failed(secret, request.remote, api::LoginGuard::Clock::now());
  if (!wait_s) return problem(401, "unauthorized", std::string(what));
  auto response = problem(429, "rate-limited",
                          "too many wrong tokens from " + request.remote + "; wait " +
                              std::to_string(*wait_s) + " s (a valid one is accepted at once)");
  retry_after(response, *wait_s);
  return response;
}

std::optional<api::Response> Authenticator::identify(api::Request& request, bool websocket,
                                                     api::Login& login) {
  for (const auto& [key, value] : request.query) {
    // A long-lived secret in an address ends in logs, histories and Referer headers.
    if (key == "token" || key == "access_token" || value.starts_with("anc_")) {
      return problem(400, "malformed",
                     "a token in the address is not accepted; send it in the header Authorization: Bearer");
    }
  }
  if (access_.options().auth_off) {
    request.principal = api::local_principal();
  } else if (const auto authorization = request.header("authorization"); !authorization.empty()) {
    const std::string secret = credential(authorization);
    const auto who = access_.verify(secret);
    if (!who) {
      access_.note_refusal("nobody", k_unknown_token, request.remote);
      return wrong_secret(request, secret, "the token is unknown, expired or revoked");
    }
    request.principal = *who;
    login = {*who, {}};
    return std::nullopt;  // no browser adds this header by itself
  } else if (const auto ticket = request.query_value("ticket"); ticket && websocket) {
    const auto made = access_.take_ticket(*ticket);
    if (!made) return wrong_secret(request, *ticket, "the ticket has been used, has expired or is unknown");
    request.principal = made->who;
    login = *made;
    return std::nullopt;
  } else if (const auto cookie = api::cookie_value(request.header("cookie"), api::k_session_cookie);
             !cookie.empty()) {
    const auto who = access_.session(cookie);
    if (!who) return std::nullopt;  // an old cookie is nobody, not an error: the login page must still load
    request.principal = *who;
    login = access_.login_of(*who, cookie);
    if (unsafe(request.method) && request.header("x-anchord") != "1") {
      return problem(403, "forbidden", "changes by a browser session need the header X-Anchord: 1");
    }
  } else if (request.path == "/metrics" && from_this_machine(request)) {
    // A scraper beside the server needs no token (api.md section 11); it is nobody anywhere else.
    request.principal = {"loopback", "loopback", {api::Role::viewer}};
    return std::nullopt;
  } else {
    return std::nullopt;
  }
  if (unsafe(request.method) && has_body(request) && form_type(request.header("content-type"))) {
    return problem(415, "media-type", "send application/json, application/x-ndjson or text/csv");
  }
  return std::nullopt;
}

std::optional<api::Response> Authenticator::limit(const api::Request& request, const api::Resolution& found) {
  if (access_.options().auth_off) return std::nullopt;
  const std::string& id = request.principal.token_id;
  std::string name = id.empty() ? "address " + request.remote : id;
  // Apart, so that a page which asks too often does not use up what a command or a login needs.
  const bool change = found.kind == api::Resolution::Kind::matched && unsafe(request.method);
  if (change && (found.route->work_of || found.route->work == api::Work::command)) name += " commands";
  if (change && found.route->pattern == "/api/v1/session") name += " logins";
  const Rate rate{options_.rate_per_s, options_.rate_burst};
  if (const auto wait_s = rate_.take(name, rate, RateLimit::Clock::now()))
    return too_many("too many requests", "server", rate, *wait_s);
  return quota(request, found);
}

/// Of one token and of all tokens of an organization, so that a customer's script takes no other's share. An
/// admin of the whole server has none: it is who raises them.
std::optional<api::Response> Authenticator::quota(const api::Request& request, const api::Resolution& found) {
  const api::Principal& who = request.principal;
  if (needed_in_flight(request, found)) return std::nullopt;
  const auto now = RateLimit::Clock::now();
  if (who.requests_per_minute) {
    const Rate rate = Rate::per_minute(*who.requests_per_minute);
    if (const auto wait_s = quotas_.take(who.token_id, rate, now))
      return too_many("this token may ask " + std::to_string(*who.requests_per_minute) +
                          " times a minute: wait, or have an administrator make another token",
                      "token", rate, *wait_s);
  }
  const auto organization = who.sites.organization();
  const auto most = organization ? access_.organizations().requests_per_minute(*organization) : std::nullopt;
  if (!most) return std::nullopt;
  const Rate rate = Rate::per_minute(*most);
  const std::string id = to_string(*organization);
  if (const auto wait_s = quotas_.take("organization " + id, rate, now))
    return too_many("the tokens of organization " + id + " may ask " + std::to_string(*most) +
                        " times a minute together: wait, or have an administrator raise it (PUT "
                        "/api/v1/organizations/" +
                        id + "/quota)",
                    "organization", rate, *wait_s);
  return std::nullopt;
}

namespace {

bool may_watch(const api::Principal& who) {
  using enum api::Role;
  return api::Access::any_of({viewer, integrator, engineer, op}).permits(who);
}

/// To a plain GET of a WebSocket's address.
api::Response upgrade_needed(const char* type, const char* detail) {
  auto response = api::problem(426, type, detail);
  response.header("Upgrade", "websocket").header("Sec-WebSocket-Version", "13");
  return response;
}

}  // namespace

Admission Authenticator::live(api::Request& request, bool websocket, api::Login login) {
  const std::string route(k_live_path);
  if (request.principal.roles.empty()) {
    return refused(problem(401, "unauthorized", "send a token, a session cookie or ?ticket="), route);
  }
  if (!may_watch(request.principal)) {
    access_.note_refusal(request.principal.token_id, "GET " + route, request.remote);
    return refused(problem(403, "forbidden", "live data needs the role viewer"), route);
  }
  if (!websocket)
    return refused(upgrade_needed("malformed", "this address is a WebSocket of subprotocol anchord.v1"),
                   route);
  Admission admission;
  admission.route = route;
  if (const auto offered = request.header("sec-websocket-protocol"); !offered.empty()) {
    const auto words = split(offered, ',');
    if (!std::ranges::any_of(words, [](std::string_view word) { return trim(word) == k_subprotocol; })) {
      return refused(problem(400, "malformed", "the only subprotocol is anchord.v1"), route);
    }
    admission.subprotocol = k_subprotocol;
  }
  auto place = places_.take(request.principal, !access_.options().auth_off);
  if (const auto* no = std::get_if<WsPlaces::Refusal>(&place)) {
    // A browser sees the close code of a connection, never the status of a handshake.
    admission.websocket = [why = *no] { return make_refusing_peer(why.first, why.second); };
    return admission;
  }
  admission.websocket = [this, who = request.principal, login = std::move(login),
                         held = std::get<std::shared_ptr<void>>(std::move(place))] {
    return make_live_peer(live_(who, [this, login] { return access_.holds(login); }), held);
  };
  return admission;
}

std::function<bool()> Authenticator::standing(const api::Login& login, std::shared_ptr<void> place) {
  return [this, login, place = std::move(place)] { return access_.holds(login); };
}

/// By a token that came in a message; nobody: it is not let in.
api::Listener Authenticator::let_in(const api::Request& request, std::string_view token) {
  if (access_.options().auth_off) return {[] { return true; }, {}};
  const auto who = access_.verify(token);
  if (!who) {
    access_.note_refusal("nobody", k_unknown_token, request.remote);
    (void)access_.guard().failed(token, request.remote, api::LoginGuard::Clock::now());
    return {};
  }
  if (!may_watch(*who)) {
    access_.note_refusal(who->token_id, "GET " + std::string(k_omlox_path), request.remote);
    return {};
  }
  auto place = places_.take(*who, true);
  if (std::holds_alternative<WsPlaces::Refusal>(place)) return {};
  return {standing({*who, {}}, std::get<std::shared_ptr<void>>(std::move(place))), who->sites};
}

/// Its clients send no header: the connection is made, and the token comes in a message.
Admission Authenticator::live_omlox(const api::Request& request, bool websocket, const api::Login& login) {
  const std::string route(k_omlox_path);
  const api::Principal& who = request.principal;
  if (!websocket && who.roles.empty())
    return refused(problem(401, "unauthorized", "send a token in the header Authorization: Bearer"), route);
  if (!who.roles.empty() && !may_watch(who)) {
    access_.note_refusal(who.token_id, "GET " + route, request.remote);
    return refused(problem(403, "forbidden", "live locations need the role viewer"), route);
  }
  if (!websocket) return refused(upgrade_needed("method", "this is a WebSocket: ask for an upgrade"), route);
  Admission admission;
  admission.route = route;
  const bool stranger = who.roles.empty();
  const api::Principal unknown{"address " + request.remote, "", {}};
  auto place = stranger ? strangers_.take(unknown, true) : places_.take(who, !access_.options().auth_off);
  if (const auto* no = std::get_if<WsPlaces::Refusal>(&place)) {
    admission.websocket = [why = *no] { return make_refusing_peer(why.first, why.second); };
    return admission;
  }
  // A stranger gives its place back once its token let it in, and then holds one as everybody does.
  const auto first =
      std::make_shared<std::shared_ptr<void>>(std::get<std::shared_ptr<void>>(std::move(place)));
  api::Request from;
  from.remote = request.remote;
  auto door = [this, first, from](std::string_view token) {
    auto in = let_in(from, token);
    if (in.holds && !access_.options().auth_off) first->reset();
    return in;
  };
  api::Listener in;
  if (!stranger) in = {standing(login.who.token_id.empty() ? api::Login{who, {}} : login, *first), who.sites};
  admission.websocket = [this, door = std::move(door), in = std::move(in)] {
    return make_live_peer(omlox_(in, door), nullptr);
  };
  return admission;
}

namespace {

/// An upload ends with the login that began it.
class HeldReader final : public api::BodyReader {
 public:
  HeldReader(api::BodyReader& inner, std::function<bool()> holds) : inner_(inner), holds_(std::move(holds)) {}
  std::size_t read(std::span<char> buffer) override {
    if (!holds_()) throw api::BodyError(401, "the login ended during the upload");
    return inner_.read(buffer);
  }

 private:
  api::BodyReader& inner_;
  std::function<bool()> holds_;
};

}  // namespace

/// The handler, and what it opens: a body that comes or goes in pieces ends within a piece of the login's
/// end.
api::Response Authenticator::run(const api::Route& route, api::Request& request, const api::Login& login) {
  if (login.who.token_id.empty()) return router_.dispatch(route, request);
  const auto holds = [this, login] { return access_.holds(login); };
  std::optional<HeldReader> held;
  api::BodyReader* const inner = request.body_stream;
  if (inner != nullptr) request.body_stream = &held.emplace(*inner, holds);
  auto response = router_.dispatch(route, request);
  request.body_stream = inner;
  if (response.body_stream) {
    response.body_stream = [pull = std::move(response.body_stream), holds] {
      if (!holds()) throw std::runtime_error("the login ended while its answer was sent");
      return pull();
    };
  }
  return response;
}

Admission Authenticator::admit(api::Request& request, std::string_view host, bool websocket) {
  Admission admission = decide(request, host, websocket);
  if (admission.refusal) router_.shape_refusal(request, *admission.refusal);
  return admission;
}

/// An answer that is at hand goes out where it was asked for, with all that the router adds to one.
Admission Authenticator::at_once(Admission admission, const api::Route& route, api::Response& answer) {
  admission.quick = true;
  const auto held = std::make_shared<api::Response>(std::move(answer));
  admission.run = [this, held, access = route.access](api::Request& r) {
    const api::Route at_hand{
        api::Method::get, {}, access, [&](const api::Request&) { return std::move(*held); }};
    return router_.dispatch(at_hand, r);
  };
  return admission;
}

Admission Authenticator::decide(api::Request& request, std::string_view host, bool websocket) {
  request.remote = options_.proxies.client(request.remote, request.header("x-forwarded-for"));
  if (closed_) {
    auto response = problem(503, "overloaded", "the server is stopping");
    retry_after(response, 5);
    return refused(std::move(response));
  }
  if ((websocket || unsafe(request.method)) &&
      !origin_allowed(request.header("origin"), host, options_.hosts)) {
    return refused(
        problem(403, "forbidden", "pages of this origin are not allowed; see the setting allowed_origins"));
  }
  api::Login login;
  if (auto no = identify(request, websocket, login)) return refused(std::move(*no));
  auto found = router_.resolve(request.method, request.path);
  const bool probe = request.path == "/healthz" || request.path == "/readyz";
  const bool file = found.kind == api::Resolution::Kind::not_found && !request.path.starts_with("/api");
  if (!probe && !file) {
    if (auto wait = limit(request, found)) return refused(std::move(*wait));
  }
  if (request.path == k_live_path) return live(request, websocket, std::move(login));
  if (request.path == k_omlox_path) return live_omlox(request, websocket, login);
  if (found.kind == api::Resolution::Kind::not_found && !unsafe(request.method)) {
    if (auto response = static_file(request)) {
      if (request.method == api::Method::options)
        *response = api::Response{204, {{"Allow", "GET, HEAD, OPTIONS"}}, {}, {}};
      return refused(std::move(*response), "static");
    }
  }
  if (found.kind != api::Resolution::Kind::matched) return refused(router_.refuse(found, request));

  const api::Route& route = *found.route;
  request.params = std::move(found.params);
  Admission admission;
  admission.route = route.pattern;
  if (!route.access.permits(request.principal)) {
    admission.refusal =
        router_.dispatch(route, request);  // 401 or 403 in its words; the handler is not reached
    if (admission.refusal->status == 403) {
      access_.note_refusal(request.principal.token_id,
                           std::string(api::to_string(request.method)) + ' ' + route.pattern, request.remote);
    }
    return admission;
  }
  admission.body_limit = route.body_limit;
  admission.streams_body = route.streams_body;
  // /healthz says that the event loop turns, so it is answered by it; /version is a constant, and two changes
  // of thread would cost more than all the rest of its answer.
  admission.quick = request.path == "/healthz" || request.path == "/version";
  if (route.method == api::Method::get && options_.at_hand) {
    if (auto answer = options_.at_hand(route, request)) return at_once(std::move(admission), route, *answer);
  }
  admission.run = [this, &route, login = std::move(login)](api::Request& r) { return run(route, r, login); };
  admission.work = [&route](const api::Request& r) { return route.work_for(r); };
  // With login off everybody is the same one.
  if (!access_.options().auth_off) {
    const std::string& id = request.principal.token_id;
    admission.share = id.empty() ? "address " + request.remote : id;
  }
  return admission;
}

api::Response Authenticator::problem(int status, std::string_view type, std::string detail) {
  return api::problem(status, type, std::move(detail));
}

bool Authenticator::is_slow(const api::Request& request, double seconds) const {
  if (options_.slow_s <= 0 || seconds < options_.slow_s) return false;
  return request.header("prefer").find("wait=") == std::string_view::npos;
}

void Authenticator::answered(const api::Request& request, std::string_view route, int status, double seconds,
                             std::size_t bytes_out) {
  metrics_.answered(route, api::to_string(request.method), status, seconds);
  const bool slow = is_slow(request, seconds);
  const LogLevel level = status >= 500 || slow ? LogLevel::warning : LogLevel::debug;
  if (!logs(level)) return;
  log(level, slow ? "slow request" : "request",
      {{"request_id", request.request_id},
       {"method", api::to_string(request.method)},
       {"path", request.path},
       {"route", route},
       {"status", std::to_string(status)},
       {"ms", std::to_string(seconds * 1000)},
       {"bytes", std::to_string(bytes_out)},
       {"from", request.remote},
       {"token", request.principal.token_id}});
}

}  // namespace anchord::server
