#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// What a file that is no text is and what to do with it ("a zip archive: unpack it first"); empty for text.
/// bytes  its beginning; a kilobyte is enough
std::string binary_file(std::string_view bytes);

}  // namespace anchord::api
