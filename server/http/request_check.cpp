#include "server/http/request_check.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "core/base/base64.hpp"
#include "core/base/text.hpp"
#include "server/http/target.hpp"
#include "server/http/text.hpp"

namespace anchord::server {
namespace {

// A second one of these would let two readers of the same bytes act differently.
constexpr std::array k_single = {std::string_view{"host"},
                                 std::string_view{"content-length"},
                                 std::string_view{"transfer-encoding"},
                                 std::string_view{"content-type"},
                                 std::string_view{"content-encoding"},
                                 std::string_view{"authorization"},
                                 std::string_view{"cookie"},
                                 std::string_view{"origin"},
                                 std::string_view{"expect"},
                                 std::string_view{"upgrade"},
                                 std::string_view{"sec-websocket-key"},
                                 std::string_view{"sec-websocket-version"},
                                 std::string_view{"x-anchord"},
                                 std::string_view{"x-request-id"},
                                 std::string_view{"idempotency-key"},
                                 std::string_view{"range"},
                                 std::string_view{"if-modified-since"},
                                 std::string_view{"content-range"}};

bool plain_value(std::string_view value) {
  return std::ranges::all_of(value, [](char c) {
    const auto u = static_cast<unsigned char>(c);
    return u == '\t' || (u >= 0x20 && u != 0x7f);
  });
}

bool listed(std::string_view list, std::string_view word) {
  for (const auto item : split(list, ',')) {
    if (iequals(trim(item), word)) return true;
  }
  return false;
}

std::optional<std::uint64_t> digits(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  const bool plain = !text.empty() && text.size() <= 19 && error == std::errc{} &&
                     end == text.data() + text.size() &&
                     std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
  return plain ? std::optional(value) : std::nullopt;
}

bool digits_only(std::string_view text) {
  return std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// Copies the fields; fails on what no reader may overlook.
std::optional<Refusal> take_fields(const ParsedHead& head, const HttpLimits& limits, api::Request& request) {
  if (head.fields.size() > limits.headers) {
    return Refusal{431, "headers-too-large", "more than " + std::to_string(limits.headers) + " headers"};
  }
  for (const auto& [name, value] : head.fields) {
    const std::string key = lower(name);
    if (!plain_value(value)) return Refusal{400, "malformed", "control character in header " + key};
    const bool text = is_utf8(value);
    // What decides or names something must be what it says; of the rest only a message or the log may tell.
    if (!text && (std::ranges::find(k_single, key) != k_single.end() || key.starts_with("if-")))
      return Refusal{400, "malformed", "header " + key + " is not UTF-8"};
    const auto [at, fresh] =
        request.headers.try_emplace(key, text ? std::string(trim(value)) : to_utf8(trim(value)));
    if (fresh) continue;
    if (std::ranges::find(k_single, key) != k_single.end()) {
      return Refusal{400, "malformed", "header " + key + " is there twice"};
    }
    at->second.append(", ").append(trim(value));
  }
  return std::nullopt;
}

std::optional<Refusal> validate_framing(const ParsedHead& head, ValidHead& good) {
  const auto& headers = good.request.headers;
  const auto coding = headers.find("transfer-encoding");
  const auto length = headers.find("content-length");
  if (coding != headers.end()) {
    if (!iequals(coding->second, "chunked")) {
      return Refusal{501, "not-implemented", "Transfer-Encoding other than chunked"};
    }
    if (length != headers.end())
      return Refusal{400, "malformed", "Transfer-Encoding and Content-Length together"};
    if (head.version < 11) return Refusal{400, "malformed", "Transfer-Encoding in HTTP/1.0"};
    good.framing = Framing::chunked;
  } else if (length != headers.end()) {
    const auto value = digits(length->second);
    if (!value) return Refusal{400, "malformed", "Content-Length is not one number"};
    good.content_length = *value;
    good.framing = *value == 0 ? Framing::none : Framing::length;
  }
  if (const auto it = headers.find("content-encoding");
      it != headers.end() && !iequals(it->second, "identity")) {
    return Refusal{415, "media-type", "compressed request bodies are not accepted"};
  }
  if (const auto it = headers.find("expect"); it != headers.end()) {
    if (!iequals(it->second, "100-continue"))
      return Refusal{417, "malformed", "Expect other than 100-continue"};
    good.expects_continue = head.version >= 11 && good.framing != Framing::none;
  }
  return std::nullopt;
}

std::optional<Refusal> validate_host(std::string_view host, const HostPolicy& policy) {
  const std::string name = host_name(host);
  if (name.empty()) return Refusal{400, "malformed", "Host is malformed"};
  if (std::ranges::find(policy.hosts, name) == policy.hosts.end()) {
    // 421 would be the newer word; 400 is what every client treats as final.
    return Refusal{400, "malformed",
                   "the host name of the request is not allowed; see the setting allowed_hosts"};
  }
  return std::nullopt;
}

std::optional<Refusal> validate_upgrade(const ParsedHead& head, ValidHead& good) {
  const auto& request = good.request;
  if (request.header("upgrade").empty()) return std::nullopt;
  if (!listed(request.header("connection"), "upgrade")) return std::nullopt;  // an offer we may ignore
  if (!iequals(request.header("upgrade"), "websocket")) return std::nullopt;
  if (head.version < 11 || request.method != api::Method::get || good.framing != Framing::none) {
    return Refusal{400, "malformed", "WebSocket handshake is not complete"};
  }
  // RFC 6455 section 4.4: the answer names the version that is spoken here.
  if (request.header("sec-websocket-version") != "13") {
    return Refusal{426,
                   "malformed",
                   "only WebSocket version 13",
                   {{"Sec-WebSocket-Version", "13"}, {"Upgrade", "websocket"}}};
  }
  const auto key = from_base64(request.header("sec-websocket-key"));
  if (!key || key->size() != 16) {
    return Refusal{400, "malformed", "Sec-WebSocket-Key must be 16 bytes in base64"};
  }
  good.websocket = true;
  return std::nullopt;
}

}  // namespace

std::string host_name(std::string_view host) {
  std::size_t end = 0;
  if (host.starts_with('[')) {
    end = host.find(']');
    if (end == std::string_view::npos) return {};
    ++end;
    const auto inside = host.substr(1, end - 2);
    const bool address = !inside.empty() && std::ranges::all_of(inside, [](char c) {
      return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f') || (c >= 'A' && c <= 'F') || c == ':' ||
             c == '.';
    });
    if (!address) return {};
  } else {
    end = std::min(host.find(':'), host.size());
    const bool name = end > 0 && end <= 253 && std::ranges::all_of(host.substr(0, end), [](char c) {
                        return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                               c == '-' || c == '.' || c == '_';
                      });
    if (!name) return {};
  }
  const auto rest = host.substr(end);
  if (!rest.empty() && (rest.size() < 2 || rest.size() > 6 || !digits_only(rest.substr(1)) || rest[0] != ':'))
    return {};
  return lower(host.substr(0, end));
}

bool origin_allowed(std::string_view origin, std::string_view host, const HostPolicy& policy) {
  if (origin.empty()) return true;
  const std::string given = lower(origin);
  if (std::ranges::find(policy.origins, given) != policy.origins.end()) return true;
  const auto scheme = given.find("://");
  return scheme != std::string::npos && (given.starts_with("http://") || given.starts_with("https://")) &&
         std::string_view(given).substr(scheme + 3) == lower(host);
}

HeadCheck validate_head(const ParsedHead& head, const HttpLimits& limits, const HostPolicy& policy) {
  ValidHead good;
  api::Request& request = good.request;
  const auto method = api::k_method_words.find(head.method);
  if (!method) return Refusal{501, "not-implemented", "unknown method"};
  request.method = *method;
  if (head.version != 10 && head.version != 11)
    return Refusal{505, "malformed", "only HTTP/1.0 and HTTP/1.1"};
  if (auto no = take_fields(head, limits, request)) return *no;

  good.version = head.version;
  const auto host = request.headers.find("host");
  if (host == request.headers.end()) return Refusal{400, "malformed", "Host is missing"};
  if (auto no = validate_host(host->second, policy)) return *no;
  auto target = split_target(head.target, limits.query_parameters);
  if (auto* why = std::get_if<std::string>(&target)) return Refusal{400, "malformed", std::move(*why)};
  auto& parts = std::get<Target>(target);
  if (!parts.authority.empty()) {
    // RFC 9112 section 3.2.2: the authority of an absolute target replaces Host.
    if (auto no = validate_host(parts.authority, policy)) return *no;
  }
  if (parts.path == "*" && *method != api::Method::options)
    return Refusal{400, "malformed", "target * is for OPTIONS"};
  good.host =
      lower(parts.authority.empty() ? std::string_view(host->second) : std::string_view(parts.authority));
  request.path = std::move(parts.path);
  request.query = std::move(parts.query);

  if (auto no = validate_framing(head, good)) return *no;
  if (auto no = validate_upgrade(head, good)) return *no;
  const auto connection = request.header("connection");
  good.keep_alive = head.version == 11 ? !listed(connection, "close") : listed(connection, "keep-alive");
  return good;
}

std::variant<HeadScan, Refusal> scan_head(std::string_view bytes, HeadScan at, const HttpLimits& limits) {
  const Refusal line_too_long{414, "uri-too-long",
                              "request line over " + std::to_string(limits.request_line_bytes) + " bytes"};
  const Refusal too_large{431, "headers-too-large",
                          "head over " + std::to_string(limits.head_bytes) + " bytes"};
  if (!bytes.empty() && (bytes[0] < 'A' || bytes[0] > 'Z')) {
    return Refusal{400, "malformed", "this is not HTTP"};  // a TLS hello, a binary protocol
  }
  while (at.scanned < bytes.size()) {
    const char c = bytes[at.scanned];
    const std::size_t i = at.scanned++;
    if (c == '\0') return Refusal{400, "malformed", "NUL in the head"};
    if (i > 0 && bytes[i - 1] == '\r' && c != '\n') return Refusal{400, "malformed", "CR without LF"};
    if (i >= limits.head_bytes) return too_large;
    if (at.lines == 0 && i >= limits.request_line_bytes) return line_too_long;
    if (i > 0 && bytes[i - 1] == '\n' && (c == ' ' || c == '\t')) {
      return Refusal{400, "malformed", "folded header line"};
    }
    if (c != '\n') continue;
    if (i == 0 || bytes[i - 1] != '\r') return Refusal{400, "malformed", "LF without CR"};
    if (i >= 3 && bytes[i - 2] == '\n') {
      at.head_end = i + 1;
      return at;
    }
    if (at.lines++ > limits.headers) {
      return Refusal{431, "headers-too-large", "more than " + std::to_string(limits.headers) + " headers"};
    }
  }
  return at;
}

}  // namespace anchord::server
