#pragma once

#include <numbers>

namespace anchord {

/// In radians.
inline constexpr double k_degree = std::numbers::pi / 180;

}  // namespace anchord
