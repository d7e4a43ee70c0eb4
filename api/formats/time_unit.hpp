#pragma once

#include <span>
#include <string>
#include <string_view>

namespace anchord::api {

/// What the values of a column of times are, where that is not what its name (t_us, t_ms, t_s, unix_s,
/// time_s) says; empty where they may be.
std::string time_unit_warning(std::string_view name, std::span<const double> values);

}  // namespace anchord::api
