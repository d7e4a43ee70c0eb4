#include "api/stream/delta.hpp"

#include <algorithm>
#include <optional>
#include <vector>

namespace anchord::api {
namespace {

struct Member {
  std::string_view key, value;  ///< the key with its quotes; empty in an array
};

/// End of the value that begins at `from`: behind its last character, npos where the text ends inside it.
std::size_t value_end(std::string_view text, std::size_t from) {
  int depth = 0;
  bool quoted = false;
  for (std::size_t i = from; i < text.size(); ++i) {
    const char c = text[i];
    if (quoted) {
      if (c == '\\') ++i;
      if (c == '"') quoted = false;
      continue;
    }
    if (c == '"') quoted = true;
    if (c == '{' || c == '[') ++depth;
    if (c == '}' || c == ']') {
      if (depth == 0) return i;
      --depth;
    }
    if (c == ',' && depth == 0) return i;
  }
  return depth == 0 && !quoted ? text.size() : std::string_view::npos;
}

/// Members of an object, or elements of an array; nothing where it is neither.
std::optional<std::vector<Member>> members(std::string_view text) {
  const bool object = text.starts_with('{') && text.ends_with('}');
  const bool array = text.starts_with('[') && text.ends_with(']');
  if (text.size() < 2 || (!object && !array)) return std::nullopt;
  const auto inner = text.substr(1, text.size() - 2);
  std::vector<Member> out;
  for (std::size_t at = 0; at < inner.size();) {
    Member one;
    if (object) {
      // A key ends at the first quote that no backslash escapes.
      std::size_t quote = at + 1;
      while (quote < inner.size() && inner[quote] != '"') quote += inner[quote] == '\\' ? 2 : 1;
      if (inner[at] != '"' || quote + 1 >= inner.size() || inner[quote + 1] != ':') return std::nullopt;
      one.key = inner.substr(at, quote + 1 - at);
      at = quote + 2;
    }
    const std::size_t end = value_end(inner, at);
    if (end == std::string_view::npos || end == at) return std::nullopt;
    one.value = inner.substr(at, end - at);
    out.push_back(one);
    if (end < inner.size() && inner[end] != ',') return std::nullopt;
    at = end + 1;
  }
  return out;
}

void append(std::string& out, std::string_view key, std::string_view value) {
  out += out.empty() ? '{' : ',';
  out.append(key);
  out += ':';
  out.append(value);
}

bool all_objects(const std::vector<Member>& elements) {
  return std::ranges::all_of(elements, [](const Member& m) { return m.value.starts_with('{'); });
}

std::string delta_of_value(std::string_view before, std::string_view after);

/// Of two arrays of as many objects; empty: they are not.
std::string delta_of_arrays(std::string_view before, std::string_view after) {
  const auto was = members(before), is = members(after);
  if (!was || !is || was->size() != is->size() || !all_objects(*was) || !all_objects(*is)) return {};
  std::string out;
  for (std::size_t i = 0; i < is->size(); ++i) {
    if ((*was)[i].value == (*is)[i].value) continue;
    append(out, '"' + std::to_string(i) + '"', delta_of_value((*was)[i].value, (*is)[i].value));
  }
  return out.empty() ? out : out + '}';
}

std::string delta_of_value(std::string_view before, std::string_view after) {
  if (before.starts_with('{') && after.starts_with('{')) return delta_of(before, after, {});
  if (before.starts_with('[') && after.starts_with('[')) {
    auto out = delta_of_arrays(before, after);
    if (!out.empty()) return out;
  }
  return std::string(after);
}

}  // namespace

std::string delta_of(std::string_view before, std::string_view after,
                     std::span<const std::string_view> always) {
  const auto was = before.starts_with('{') ? members(before) : std::nullopt;
  const auto is = after.starts_with('{') ? members(after) : std::nullopt;
  if (!was || !is) return std::string(after);
  std::string out;
  for (const auto& member : *is) {
    const auto name = member.key.substr(1, member.key.size() - 2);
    const auto old = std::ranges::find(*was, member.key, &Member::key);
    if (old == was->end() || std::ranges::find(always, name) != always.end())
      append(out, member.key, member.value);
    else if (old->value != member.value)
      append(out, member.key, delta_of_value(old->value, member.value));
  }
  for (const auto& member : *was) {
    if (std::ranges::find(*is, member.key, &Member::key) == is->end()) append(out, member.key, "null");
  }
  return out.empty() ? "{}" : out + '}';
}

}  // namespace anchord::api
