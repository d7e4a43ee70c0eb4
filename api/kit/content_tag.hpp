#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// An ETag that is that of the bytes (XXH3, 64 bit): the same for the same, at any time and on any server.
std::string content_tag(std::string_view bytes, std::string_view prefix);
std::string weak_content_tag(std::string_view bytes);

/// Whether an If-None-Match names it, or everything; weak and strong tags of one content are the same here.
bool etag_listed(std::string_view list, std::string_view etag);

}  // namespace anchord::api
