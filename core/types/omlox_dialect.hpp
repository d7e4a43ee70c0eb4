#pragma once

#include <cstdint>

#include "core/base/enum_table.hpp"

namespace anchord {

/// How an omlox hub writes ground control points, and what it lists at /zones.
enum class OmloxDialect : std::uint8_t {
  official,  ///< Hub API 2.0.0: geographic and local numbers in turn in one array; ids
  objects,   ///< open-location-hub: {"wgs84": Point, "local": Point}; objects
};
inline constexpr auto k_dialect_words =
    enum_table<OmloxDialect>({{"official", OmloxDialect::official}, {"objects", OmloxDialect::objects}});

}  // namespace anchord
