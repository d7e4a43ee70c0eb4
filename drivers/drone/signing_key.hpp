#pragma once

#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/mavlink/frame.hpp"

namespace anchord::drone {

/// The key of MAVLink 2 signing: 64 hexadecimal digits, or the 32 bytes themselves. White space at the end
/// does not count. errors  invalid_argument, never with the text in it
Result<mavlink::Secret> parse_signing_key(std::string_view text);
/// Of a file that only its owner may read. errors  not_found; invalid_argument: permissions, or no key in it
Result<mavlink::Secret> read_signing_key(const std::string& file);

}  // namespace anchord::drone
