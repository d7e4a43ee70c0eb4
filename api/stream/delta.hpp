#pragma once

#include <span>
#include <string>
#include <string_view>

namespace anchord::api {

/// What of one JSON object differs from the one before, as an object of its own: members that are new or have
/// another value, null for those that are gone, and `always`. A member that is an object in both is a
/// difference again; an array of as many objects in both is an object of its indices: {"2": {"value": 0.03}}.
/// Both texts as to_wire() writes them, without spaces; a text of another shape gives `after` whole. Pure;
/// microseconds.
std::string delta_of(std::string_view before, std::string_view after,
                     std::span<const std::string_view> always);

}  // namespace anchord::api
