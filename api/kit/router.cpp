#include "api/kit/router.hpp"

#include <array>
#include <new>
#include <optional>

#include "api/kit/content_tag.hpp"
#include "api/kit/problem.hpp"
#include "core/base/check.hpp"
#include "core/base/guard.hpp"
#include "core/base/ids.hpp"
#include "core/base/text.hpp"

namespace anchord::api {
namespace {

/// A path or pattern cut at its slashes, nothing copied; no pattern of ours comes near the most there is room
/// for, and a longer path matches none.
struct Segments {
  std::array<std::string_view, 16> parts;
  std::size_t count{0};  ///< beyond the room: too many

  explicit Segments(std::string_view path) {
    std::size_t at = 0;
    while (at < path.size()) {
      const std::size_t next = path.find('/', at + 1);
      if (count < parts.size())
        parts[count] = path.substr(at + 1, next == std::string_view::npos ? next : next - at - 1);
      ++count;
      if (next == std::string_view::npos) break;
      at = next;
    }
  }
  bool too_many() const { return count > parts.size(); }
};

/// The pattern of a route, cut when the route is added.
struct Pattern {
  struct Part {
    std::string text;  ///< of a parameter: its name
    bool parameter{};
  };
  std::size_t route{};  ///< which it is
  std::vector<Part> parts;

  Pattern(std::size_t of_route, const Segments& cut) : route(of_route) {
    for (std::size_t i = 0; i < cut.count; ++i) {
      const auto part = cut.parts[i];
      const bool parameter = part.size() > 2 && part.front() == '{';
      parts.push_back({std::string(parameter ? part.substr(1, part.size() - 2) : part), parameter});
    }
  }
  /// How many parts are the path's own words; nothing where it is another path.
  std::optional<int> literals(const Segments& path) const {
    int same = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (parts[i].parameter ? path.parts[i].empty() : parts[i].text != path.parts[i]) return std::nullopt;
      same += parts[i].parameter ? 0 : 1;
    }
    return same;
  }
  std::map<std::string, std::string> params(const Segments& path) const {
    std::map<std::string, std::string> out;
    for (std::size_t i = 0; i < parts.size(); ++i) {
      if (parts[i].parameter) out.emplace(parts[i].text, path.parts[i]);
    }
    return out;
  }
};

bool has_header(const Response& response, std::string_view name) {
  for (const auto& [key, value] : response.headers) {
    if (key == name) return true;
  }
  return false;
}

void conditional_get(const Request& request, Response& response) {
  if ((request.method != Method::get && request.method != Method::head) || response.status != 200 ||
      response.body_stream) {
    return;
  }
  if (!has_header(response, "ETag")) response.header("ETag", weak_content_tag(response.body));
  const auto wanted = request.header("if-none-match");
  if (wanted.empty()) return;
  for (const auto& [key, value] : response.headers) {
    if (key == "ETag" && etag_listed(wanted, value)) {
      response.status = 304;
      response.body.clear();
      return;
    }
  }
}

/// Asks what would be done, and changes nothing.
bool is_dry_run(const Request& request) {
  const auto asked = request.query_value("dry_run");
  return asked && *asked != "false" && *asked != "0";
}

/// A problem made below knows neither where it happened nor for whom: say both here.
void complete_problem(const Request& request, Response& response) {
  if (response.status < 400 || response.body.size() < 2 || response.body.back() != '}') return;
  if (response.body.find("\"instance\":") != std::string::npos) return;
  response.body.pop_back();
  append_json_text(response.body += ",\"instance\":", request.path);
  append_json_text(response.body += ",\"request_id\":", request.request_id);
  response.body += '}';
}

/// "/api/v1/missions/ID" of what is below it; empty where the path names no id there.
std::string resource_of(std::string_view path) {
  const Segments cut(path);
  if (cut.count < 4 || cut.too_many() || !parse_uuid(cut.parts[3])) return {};
  std::string out;
  for (std::size_t i = 0; i < 4; ++i) (out += '/') += cut.parts[i];
  return out;
}

}  // namespace

bool Access::permits(const Principal& who) const {
  if (kind_ == Kind::open || who.has(Role::admin)) return true;
  if (kind_ == Kind::any_token) return !who.roles.empty();
  for (const Role role : roles_) {
    if (who.has(role)) return true;
  }
  return false;
}

struct Router::State {
  std::vector<Route> routes;
  std::vector<std::vector<Pattern>> patterns;  ///< by the number of their parts
  std::unique_ptr<Idempotency> idempotency, of_commands;
  std::function<void(std::string_view, std::string_view)> fault;
  BoundRun run_bound;
  std::vector<std::pair<std::string, std::function<void(Response&)>>> shapes;  ///< of refusals, by prefix
};

Router::Router() : state_(std::make_unique<State>()) {}
Router::Router(AccessStore& answers, std::function<std::int64_t()> running_ns, AccessStore& prompt)
    : Router() {
  state_->idempotency = std::make_unique<Idempotency>(answers, running_ns);
  state_->of_commands = std::make_unique<Idempotency>(prompt, std::move(running_ns));
}
bool Router::purge_answers() const {
  if (!state_->idempotency) return false;
  state_->of_commands->forget_use();  // they share what is kept
  return state_->idempotency->purge();
}
Router::~Router() = default;
Router::Router(Router&&) noexcept = default;
Router& Router::operator=(Router&&) noexcept = default;

void Router::add(Route route) {
  const Segments cut(route.pattern);
  ANCHORD_CHECK(!cut.too_many(), "the pattern " << route.pattern << " has too many parts");
  if (state_->patterns.size() <= cut.count) state_->patterns.resize(cut.count + 1);
  state_->patterns[cut.count].emplace_back(state_->routes.size(), cut);
  state_->routes.push_back(std::move(route));
}
const std::vector<Route>& Router::routes() const { return state_->routes; }
void Router::refusals_under(std::string prefix, std::function<void(Response&)> shape) {
  state_->shapes.emplace_back(std::move(prefix), std::move(shape));
}
void Router::shape_refusal(const Request& request, Response& response) const {
  if (response.status < 400) return;
  for (const auto& [prefix, shape] : state_->shapes) {
    if (request.path.starts_with(prefix)) return shape(response);
  }
}
void Router::run_bound_by(BoundRun run) { state_->run_bound = std::move(run); }
void Router::on_fault(std::function<void(std::string_view, std::string_view)> log) {
  state_->fault = std::move(log);
}

/// Literal parts win over parameters, so that /anchors/stats and /anchors/{id} may be side by side.
Resolution Router::resolve(Method method, std::string_view path) const {
  Resolution found;
  const Segments cut(path);
  if (cut.count >= state_->patterns.size()) return found;
  const Method wanted = method == Method::head ? Method::get : method;
  const Pattern* best = nullptr;
  int best_literals = -1;
  for (const Pattern& pattern : state_->patterns[cut.count]) {
    const auto literals = pattern.literals(cut);
    if (!literals) continue;
    const Route& route = state_->routes[pattern.route];
    const std::string_view name = to_string(route.method);
    if (found.allow.find(name) == std::string::npos)
      found.allow.append(name).append(route.method == Method::get ? ", HEAD, " : ", ");
    if (route.method == wanted && *literals > best_literals) {
      best_literals = *literals;
      best = &pattern;
    }
  }
  if (found.allow.empty()) return found;
  found.allow += "OPTIONS";
  found.kind = best == nullptr ? Resolution::Kind::method_not_allowed : Resolution::Kind::matched;
  if (best != nullptr) {
    found.route = &state_->routes[best->route];
    found.params = best->params(cut);
  }
  return found;
}

Response Router::refuse(const Resolution& resolution, const Request& request) const {
  Response response;
  if (resolution.kind == Resolution::Kind::not_found) {
    response = problem(404, "not-found", "there is nothing at this address");
  } else if (request.method == Method::options) {
    response.status = 204;
  } else {
    response = problem(405, "method", "this address supports only " + resolution.allow);
  }
  if (!resolution.allow.empty()) response.header("Allow", resolution.allow);
  complete_problem(request, response);
  shape_refusal(request, response);
  return response;
}

/// What was kept for a token of an organization may be of a site that has left it since: then what the
/// request and its answer name is not there any more.
void Router::forget_what_left(const Request& request, Response& response) const {
  if (!request.principal.sites.organization()) return;
  std::string made;
  bool kept = false;
  for (const auto& [name, value] : response.headers) {
    if (name == "Location") made = value;
    kept |= name == "Idempotent-Replayed";
  }
  if (!kept) return;
  for (const std::string& path : {made, resource_of(request.path)}) {
    if (path.empty()) continue;
    auto found = resolve(Method::get, path);
    if (found.kind != Resolution::Kind::matched) continue;
    Request ask;
    ask.method = Method::get;
    ask.path = path;
    ask.params = std::move(found.params);
    ask.principal = request.principal;
    ask.request_id = request.request_id;
    Response there = dispatch(*found.route, ask);
    if (there.status != 404) continue;
    response = std::move(there);
    return;
  }
}

Response Router::handle(Request& request) const {
  auto resolution = resolve(request.method, request.path);
  if (resolution.kind != Resolution::Kind::matched) return refuse(resolution, request);
  request.params = std::move(resolution.params);
  return dispatch(*resolution.route, request);
}

Response Router::dispatch(const Route& route, Request& request) const {
  Response response;
  const auto handled = [&](Request& r) {
    try {
      if (r.principal.sites.all()) return route.handler(r);
      if (!state_->run_bound)
        return problem(403, "forbidden", "tokens that are bound to sites are refused here");
      return state_->run_bound(route, r);
    } catch (ProblemException& refused) {
      return std::move(refused.response);
    }
  };
  const auto answer = [&] {
    if (!route.access.permits(request.principal)) {
      if (request.principal.roles.empty()) {
        response = problem(401, "unauthorized", "send a token in the header Authorization: Bearer");
      } else {
        std::string needed;
        for (const Role role : route.access.roles())
          needed += (needed.empty() ? "" : " or ") + std::string(to_string(role));
        response = problem(403, "forbidden", "this needs the role " + (needed.empty() ? "admin" : needed));
      }
    } else if (route.needs_if_match && request.header("if-match").empty()) {
      response =
          problem(428, "precondition-required", "send the header If-Match with the ETag that was read");
    } else if (route.method == Method::post && state_->idempotency && route.keeps != Keeps::nothing &&
               !is_dry_run(request) && !request.header("idempotency-key").empty()) {
      const bool prompt = route.work_for(request) == Work::command;
      response = (prompt ? state_->of_commands : state_->idempotency)->run(request, route.keeps, handled);
      forget_what_left(request, response);
    } else {
      response = handled(request);
    }
  };
  const auto ran = guarded(route.pattern, [&] {
    try {
      answer();
    } catch (const BodyError& lost) {
      response = problem(lost.status(),
                         lost.status() == 413   ? "too-large"
                         : lost.status() == 401 ? "unauthorized"
                                                : "malformed",
                         lost.what());
      response.header("Connection", "close");
    } catch (const std::bad_alloc&) {
      response = problem(503, "overloaded", "out of memory");
      if (state_->fault) state_->fault(request.request_id, "out of memory");
    }
  });
  if (!ran) {
    if (state_->fault) state_->fault(request.request_id, ran.what);
    response = problem(500, "internal", "");
  }
  conditional_get(request, response);
  complete_problem(request, response);
  shape_refusal(request, response);
  if (!request.request_id.empty()) response.header("X-Request-Id", request.request_id);
  if (!has_header(response, "Cache-Control")) {
    // A browser may keep an answer and asks each time whether it still holds; positions are not for proxies.
    const bool kept =
        response.status < 400 && (request.method == Method::get || request.method == Method::head);
    response.header("Cache-Control", kept ? "private, no-cache" : "no-store");
  }
  return response;
}

}  // namespace anchord::api
