#include "server/http/target.hpp"

#include <algorithm>
#include <optional>

#include "core/base/text.hpp"
#include "server/http/text.hpp"

namespace anchord::server {
namespace {

int hex(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

/// Null when the encoding is broken or hides something that must not be there.
std::optional<std::string> decode(std::string_view text, bool query) {
  std::string out;
  out.reserve(text.size());
  for (std::size_t i = 0; i < text.size(); ++i) {
    char c = text[i];
    if (c == '+' && query) {
      c = ' ';  // as HTML forms and URLSearchParams write a space
    } else if (c == '%') {
      if (i + 2 >= text.size()) return std::nullopt;
      const int high = hex(text[i + 1]), low = hex(text[i + 2]);
      if (high < 0 || low < 0) return std::nullopt;
      c = static_cast<char>(high * 16 + low);
      i += 2;
      if (c == '/' && !query) return std::nullopt;  // would move a border between segments
    }
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) return std::nullopt;
    out.push_back(c);
  }
  if (!is_utf8(out)) return std::nullopt;
  return out;
}

bool has_dot_segment(std::string_view path) {
  return std::ranges::any_of(split(path, '/'), [](std::string_view s) { return s == "." || s == ".."; });
}

}  // namespace

std::variant<Target, std::string> split_target(std::string_view target, std::size_t max_parameters) {
  using namespace std::string_literals;
  Target parts;
  if (target == "*") {
    parts.path = "*";
    return parts;
  }
  if (!target.starts_with('/')) {
    const auto scheme = target.find("://");
    if (scheme == std::string_view::npos ||
        (!iequals(target.substr(0, scheme), "http") && !iequals(target.substr(0, scheme), "https"))) {
      return "the request target is neither a path nor an http address"s;
    }
    target.remove_prefix(scheme + 3);
    const auto end = std::min(target.find_first_of("/?#"), target.size());
    parts.authority = std::string(target.substr(0, end));
    if (parts.authority.empty()) return "the request target has no host"s;
    target.remove_prefix(end);
  }
  if (target.find('#') != std::string_view::npos) return "fragment in the request target"s;
  if (!std::ranges::all_of(target, [](char c) { return c > 0x20 && c < 0x7f; })) {
    return "the request target holds bytes that must be percent-encoded"s;
  }
  const auto mark = target.find('?');
  auto path = decode(target.substr(0, mark), false);
  if (!path) return "broken percent-encoding in the path, or bytes that are not UTF-8"s;
  parts.path = path->empty() ? "/" : std::move(*path);
  if (has_dot_segment(parts.path) || parts.path.find('\\') != std::string::npos)
    return "dot segments in the path"s;
  if (mark == std::string_view::npos) return parts;
  for (const auto pair : split(target.substr(mark + 1), '&')) {
    if (pair.empty()) continue;
    const auto equals = pair.find('=');
    auto key = decode(pair.substr(0, equals), true);
    auto value =
        decode(equals == std::string_view::npos ? std::string_view{} : pair.substr(equals + 1), true);
    if (!key || !value || key->empty())
      return "broken percent-encoding in the query, or bytes that are not UTF-8"s;
    if (parts.query.size() >= max_parameters)
      return "more than " + std::to_string(max_parameters) + " query parameters";
    if (!parts.query.emplace(*key, std::move(*value)).second)
      return "query parameter '" + *key + "' is there twice";
  }
  return parts;
}

}  // namespace anchord::server
