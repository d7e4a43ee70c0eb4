#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// One CSV cell: quoted where needed; a text that begins like a formula and is no number gets a leading
/// apostrophe.
std::string csv_text(std::string_view text);

}  // namespace anchord::api
