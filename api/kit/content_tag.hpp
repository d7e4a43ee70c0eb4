#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// An ETag that is that of the bytes (XXH3, 64 bit): the same for the same, at any time and on any server.
std::string content_tag(std::string_view bytes, std::string_view prefix);
std::string weak_content_tag(std::string_view bytes);

}  // namespace anchord::api
