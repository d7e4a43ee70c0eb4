#include "server/storage/outline_text.hpp"

#include <nlohmann/json.hpp>

#include "core/base/to_wire.hpp"

namespace anchord::sql {

std::string outline_text(const GeoRings& rings) {
  return rings.empty() ? std::string() : to_wire(polygon_of<nlohmann::json>(rings));
}

GeoRings outline_in(std::string_view text) {
  std::string wrong;
  return rings_of(nlohmann::json::parse(text, nullptr, false), wrong).value_or(GeoRings{});
}

}  // namespace anchord::sql
