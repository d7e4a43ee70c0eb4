#pragma once

#include <string>
#include <string_view>

#include "core/types/geo_rings.hpp"

namespace anchord::sql {

/// Rings as a column keeps them, a GeoJSON Polygon with every digit; empty: none.
std::string outline_text(const GeoRings& rings);
/// And back. Of a text that is no Polygon, which older servers kept and nothing ever used: none.
GeoRings outline_in(std::string_view text);

}  // namespace anchord::sql
