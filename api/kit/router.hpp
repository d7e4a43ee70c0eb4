#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "api/kit/idempotency.hpp"
#include "api/kit/message.hpp"
#include "api/kit/work.hpp"

namespace anchord::api {

/// Who may use a route. There is no default: a route without a decision does not compile.
class Access {
 public:
  static Access open() { return Access(Kind::open, {}); }            ///< no token needed
  static Access any_token() { return Access(Kind::any_token, {}); }  ///< every role
  static Access any_of(std::vector<Role> roles) { return Access(Kind::roles, std::move(roles)); }
  bool is_open() const { return kind_ == Kind::open; }
  /// admin may do everything.
  bool permits(const Principal& who) const;
  const std::vector<Role>& roles() const { return roles_; }

 private:
  enum class Kind : std::uint8_t { open, any_token, roles };
  Access(Kind kind, std::vector<Role> roles) : kind_(kind), roles_(std::move(roles)) {}
  Kind kind_;
  std::vector<Role> roles_;
};

/// One operation. `pattern` has whole-segment parameters: "/api/v1/anchors/{id}".
struct Route {
  Method method;
  std::string pattern;
  Access access;
  Handler handler;
  std::uint64_t body_limit{1 << 20};
  bool streams_body{false};    ///< the handler pulls Request::body_stream instead of reading body
  bool needs_if_match{false};  ///< 428 without the header; the handler compares it
  Work work{Work::ordinary};
  /// Where the body decides (actions of a mission); asked on an io thread, with the whole body. Else `work`
  /// holds.
  std::function<Work(const Request&)> work_of{};
  Keeps keeps{Keeps::answer};  ///< of POST, for its Idempotency-Key
  Work work_for(const Request& request) const { return work_of ? work_of(request) : work; }
};
/// The same route, run by another executor than the ordinary one.
inline Route as_command(Route route) {
  route.work = Work::command;
  return route;
}
inline Route as_flight(Route route) {
  route.work = Work::flight;
  return route;
}
inline Route as_heavy(Route route) {
  route.work = Work::heavy;
  return route;
}
/// A POST that changes nothing, or whose answer is a secret: nothing is kept of it.
inline Route keeps_nothing(Route route) {
  route.keeps = Keeps::nothing;
  return route;
}
/// A POST that must be done whatever the token has kept already: commands of a flight, measurements.
inline Route keeps_always(Route route) {
  route.keeps = Keeps::always;
  return route;
}

/// Bodies of commands are small, and parsed before an executor is chosen.
inline constexpr std::uint64_t k_command_bytes = 16 * 1024;

struct Resolution {
  enum class Kind : std::uint8_t { matched, not_found, method_not_allowed };
  Kind kind{Kind::not_found};
  const Route* route{nullptr};                ///< when matched; HEAD resolves to the GET route
  std::map<std::string, std::string> params;  ///< for Request::params
  std::string allow;                          ///< "GET, HEAD, OPTIONS", when the path exists
};

/// The route table. Filled at start, then read from any thread.
class Router {
 public:
  /// Ignores Idempotency-Key.
  Router();
  /// Where answers to Idempotency-Key are kept, and running time to age them by. `prompt` keeps those of
  /// commands, which must not wait for the disk.
  Router(AccessStore& answers, std::function<std::int64_t()> running_ns, AccessStore& prompt);
  ~Router();
  Router(Router&&) noexcept;
  Router& operator=(Router&&) noexcept;

  void add(Route route);
  Resolution resolve(Method method, std::string_view path) const;

  /// Judges roles (401, 403), If-Match (428), Idempotency-Key (replay, 409, 422), calls the handler, turns
  /// what it throws into a problem, answers If-None-Match with 304 and adds ETag, Cache-Control and
  /// X-Request-Id. Request::params must hold those of the resolution.
  Response dispatch(const Route& route, Request& request) const;

  /// resolve + dispatch, with 404, 405 and OPTIONS.
  Response handle(Request& request) const;
  /// The answer where nothing matched; OPTIONS on a known path gives 204 with Allow.
  Response refuse(const Resolution& resolution, const Request& request) const;

  const std::vector<Route>& routes() const;

  /// Answers for whoever is bound to sites, by the route's handler or a problem; without one they are refused
  /// everywhere. Set at start.
  using BoundRun = std::function<Response(const Route&, const Request&)>;
  void run_bound_by(BoundRun run);

  /// Drops kept answers that have expired, a slice at a time; says whether there may be more.
  bool purge_answers() const;

  /// Answers of 4xx and 5xx under this prefix are given to `shape` before they leave: for an API of somebody
  /// else whose errors are no problem documents. Set at start.
  void refusals_under(std::string prefix, std::function<void(Response&)> shape);
  /// Does it to an answer that was made outside of the router.
  void shape_refusal(const Request& request, Response& response) const;

  /// Told about every exception that reached the door (a bug, or the ground gave way); for the log.
  void on_fault(std::function<void(std::string_view request_id, std::string_view what)> log);

 private:
  void forget_what_left(const Request& request, Response& response) const;
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace anchord::api
