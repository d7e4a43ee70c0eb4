#pragma once

#include <string>
#include <string_view>

namespace anchord::api {

/// A name as one level of an MQTT topic: '%' and two hexadecimal digits stand for each byte that a topic may
/// not have, or that means something in one ('/', '+', '#', control characters, a leading '$'), or here ('%',
/// '~', a leading '_'). No two names give the same level, and none is empty.
std::string topic_level(std::string_view name);

/// Why text cannot be what all topics begin with; empty: it can.
std::string wrong_prefix(std::string_view prefix);

}  // namespace anchord::api
