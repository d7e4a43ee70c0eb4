#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/base/site_set.hpp"

namespace anchord::api {

enum class Method : std::uint8_t { get, head, post, put, patch, del, options };
inline constexpr auto k_method_words = enum_table<Method>({{"GET", Method::get},
                                                           {"HEAD", Method::head},
                                                           {"POST", Method::post},
                                                           {"PUT", Method::put},
                                                           {"PATCH", Method::patch},
                                                           {"DELETE", Method::del},
                                                           {"OPTIONS", Method::options}});
constexpr std::string_view to_string(Method method) { return k_method_words.word(method); }

/// Rights of a token; not a ladder (a gateway may ingest and nothing else).
enum class Role : std::uint8_t { viewer, integrator, gateway, engineer, op, admin };
inline constexpr auto k_role_words = enum_table<Role>({{"viewer", Role::viewer},
                                                       {"integrator", Role::integrator},
                                                       {"gateway", Role::gateway},
                                                       {"engineer", Role::engineer},
                                                       {"operator", Role::op},
                                                       {"admin", Role::admin}});
constexpr std::string_view to_string(Role role) { return k_role_words.word(role); }

/// Who asks. Empty roles: nobody.
struct Principal {
  std::string token_id;  ///< for the audit log; "local" with --auth=off
  std::string name;
  std::vector<Role> roles;
  SiteSet sites{};                                     ///< what the token is bound to
  std::optional<std::uint32_t> requests_per_minute{};  ///< of the token alone, at most
  bool has(Role role) const {
    for (const Role r : roles) {
      if (r == role) return true;
    }
    return false;
  }
};

/// A body that did not arrive whole: 408 time-out, 413 excess, 400 lost peer or broken framing.
class BodyError : public std::runtime_error {
 public:
  BodyError(int status, const std::string& what) : std::runtime_error(what), status_(status) {}
  int status() const { return status_; }

 private:
  int status_;
};

/// Pulls a request body that is too large to hold. The server reads the socket inside read().
class BodyReader {
 public:
  virtual ~BodyReader() = default;
  /// Next bytes, at most buffer.size(); 0 at the end. Throws ProblemException (api/kit/problem.hpp) when the
  /// peer is gone, too slow, sends too much or breaks the framing.
  virtual std::size_t read(std::span<char> buffer) = 0;
};

/// A request whose head was judged and whose target was split; names of headers are lower case.
struct Request {
  Method method{Method::get};
  std::string path;                          ///< percent-decoded, starts with '/'
  std::map<std::string, std::string> query;  ///< percent-decoded; a repeated key is refused before
  std::map<std::string, std::string> headers;
  std::map<std::string, std::string> params;  ///< of the route template, e.g. {"id": "0x6a2f"}
  std::string body;                           ///< whole, for ordinary routes
  BodyReader* body_stream{nullptr};           ///< for routes that stream (bulk ingest); else null
  Principal principal;
  std::string request_id;
  std::string remote;

  std::string_view header(std::string_view name) const {
    const auto it = headers.find(std::string(name));
    return it == headers.end() ? std::string_view{} : std::string_view{it->second};
  }
  std::optional<std::string> query_value(std::string_view name) const {
    const auto it = query.find(std::string(name));
    if (it == query.end()) return std::nullopt;
    return it->second;
  }
};

/// Pushes a response body that is too large to hold. Called repeatedly; an empty string ends the body.
using BodyWriter = std::function<std::string()>;

struct Response {
  int status{200};
  std::vector<std::pair<std::string, std::string>> headers;
  std::string body;
  BodyWriter body_stream;  ///< when set, body is ignored and the answer is chunked

  Response& header(std::string name, std::string value) {
    headers.emplace_back(std::move(name), std::move(value));
    return *this;
  }
};

/// A handler is a plain function: no coroutine, no socket, may block on the database.
using Handler = std::function<Response(const Request&)>;

}  // namespace anchord::api
