#pragma once

#include <string>
#include <string_view>

namespace anchord::server {

/// The client's id when it is 1 to 64 of [A-Za-z0-9._-], which cannot forge a log line; else a new random
/// one.
std::string request_id_of(std::string_view given);

}  // namespace anchord::server
