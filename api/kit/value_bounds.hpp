#pragma once

#include <cstdint>

namespace anchord::api {

/// What a number may be, both ends included.
struct Bounds {
  double min{}, max{};
  constexpr bool hold(double value) const { return value >= min && value <= max; }
};
struct WholeBounds {
  std::int64_t min{}, max{};
  constexpr bool hold(std::int64_t value) const { return value >= min && value <= max; }
};

}  // namespace anchord::api
