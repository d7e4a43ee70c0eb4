#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

#include "api/kit/message.hpp"
#include "server/http/limits.hpp"

namespace anchord::server {

/// A request head as parsed, before anybody believed it. Views into the connection's buffer.
struct ParsedHead {
  std::string_view raw;     ///< from the request line to the empty line
  std::string_view method;  ///< as sent
  std::string_view target;
  unsigned version{11};                                               ///< 10 or 11
  std::vector<std::pair<std::string_view, std::string_view>> fields;  ///< in order, names as sent
};

enum class Framing : std::uint8_t { none, length, chunked };

/// A head that was found good.
struct ValidHead {
  api::Request request;  ///< without principal, params and body
  unsigned version{11};  ///< 10 or 11
  Framing framing{Framing::none};
  std::uint64_t content_length{0};
  bool expects_continue{false};
  bool keep_alive{true};
  bool websocket{false};  ///< asks for an upgrade, completely and correctly
  std::string host;       ///< lower case with port as sent, for the Origin check
};

/// Why not. After it the connection is closed: what follows on the wire can no longer be trusted.
struct Refusal {
  int status{400};
  std::string_view type{"malformed"};  ///< last part of the problem type
  std::string detail;
  std::vector<std::pair<std::string, std::string>> headers{};  ///< what else the answer must carry
};

using HeadCheck = std::variant<ValidHead, Refusal>;

/// The one judge of request heads. The parser accepts what is grammatical; this refuses what is ambiguous or
/// not ours to serve: Host missing, twice, malformed or foreign; absolute-form (routed by path, judged by
/// authority); folded lines; Content-Length as a list; Transfer-Encoding other than exactly "chunked";
/// Content-Encoding; repeated headers that decide; broken percent-encoding; repeated query keys; too many of
/// anything. Pure; any thread.
HeadCheck validate_head(const ParsedHead& head, const HttpLimits& limits, const HostPolicy& policy);

/// Looks at raw bytes of a head that is still arriving: line ends, sizes, first character.
/// Null: nothing wrong so far. `head_end` becomes the size of the head once its empty line has come, else 0.
struct HeadScan {
  std::size_t head_end{0};
  std::size_t scanned{0};  ///< where the next call goes on
  std::size_t lines{0};
};
/// Returns a refusal as soon as one is certain.
std::variant<HeadScan, Refusal> scan_head(std::string_view bytes, HeadScan before, const HttpLimits& limits);

/// Host without port, lower case; empty when malformed.
std::string host_name(std::string_view host);
/// May a page of this Origin use a server reached as `host`? An absent Origin (empty) is no browser: yes.
bool origin_allowed(std::string_view origin, std::string_view host, const HostPolicy& policy);

}  // namespace anchord::server
