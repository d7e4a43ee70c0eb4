#include "api/kit/content_tag.hpp"

#define XXH_INLINE_ALL  // no library at run time
#include <xxhash.h>

#include <array>
#include <cctype>
#include <charconv>

namespace anchord::api {

std::string content_tag(std::string_view bytes, std::string_view prefix) {
  std::array<char, 16> hex{};
  const auto hash = XXH3_64bits(bytes.data(), bytes.size());
  const auto end = std::to_chars(hex.data(), hex.data() + hex.size(), hash, 16);
  std::string tag{'"'};
  tag.append(prefix).append(hex.data(), end.ptr);
  return tag + '"';
}

bool etag_listed(std::string_view list, std::string_view etag) {
  const auto strong = [](std::string_view tag) { return tag.substr(0, 2) == "W/" ? tag.substr(2) : tag; };
  while (!list.empty()) {
    auto comma = list.find(',');
    auto item = list.substr(0, comma);
    while (!item.empty() && std::isspace(static_cast<unsigned char>(item.front())) != 0)
      item.remove_prefix(1);
    while (!item.empty() && std::isspace(static_cast<unsigned char>(item.back())) != 0) item.remove_suffix(1);
    if (item == "*" || strong(item) == strong(etag)) return true;
    if (comma == std::string_view::npos) break;
    list.remove_prefix(comma + 1);
  }
  return false;
}

std::string weak_content_tag(std::string_view bytes) { return "W/" + content_tag(bytes, {}); }

}  // namespace anchord::api
