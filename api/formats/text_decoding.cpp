#include "api/formats/text_decoding.hpp"

#include <iconv.h>

#include <array>
#include <cerrno>

#include "core/base/text.hpp"

namespace anchord::api {
namespace {

/// From the encoding into UTF-8; what is no character of it becomes U+FFFD.
std::string converted(std::string_view bytes, const char* encoding) {
  const iconv_t way = iconv_open("UTF-8", encoding);
  if (way == iconv_t(-1)) return to_utf8(bytes);
  std::string in(bytes), out;
  char* from = in.data();
  std::size_t left = in.size();
  std::array<char, 65536> buffer{};
  while (left > 0) {
    char* to = buffer.data();
    std::size_t room = buffer.size();
    const auto done = iconv(way, &from, &left, &to, &room);
    out.append(buffer.data(), buffer.size() - room);
    if (done != std::size_t(-1) || errno == E2BIG) continue;
    out += "\xEF\xBF\xBD";
    ++from;
    --left;
  }
  iconv_close(way);
  return out;
}

}  // namespace

std::string decoded(std::string_view bytes) {
  if (bytes.starts_with("\xFF\xFE")) return converted(bytes.substr(2), "UTF-16LE");
  if (bytes.starts_with("\xFE\xFF")) return converted(bytes.substr(2), "UTF-16BE");
  if (bytes.starts_with("\xEF\xBB\xBF")) bytes.remove_prefix(3);
  return is_utf8(bytes) ? std::string(bytes) : converted(bytes, "WINDOWS-1252");
}

}  // namespace anchord::api
