#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// A file of another program as UTF-8: by its byte order mark (UTF-16, UTF-8), else UTF-8, else the Western
/// European of Windows, which old programs write. What is no character becomes U+FFFD.
std::string decoded(std::string_view bytes);

}  // namespace anchord::api
