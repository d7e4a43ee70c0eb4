#include "api/kit/content_tag.hpp"

#define XXH_INLINE_ALL  // no library at run time
#include <xxhash.h>

#include <array>
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

std::string weak_content_tag(std::string_view bytes) { return "W/" + content_tag(bytes, {}); }

}  // namespace anchord::api
