#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>

#include "core/base/result.hpp"
#include "core/types/lon_lat_box.hpp"
#include "core/types/place.hpp"

namespace anchord {
class PlaceStore;
}

namespace anchord::api {

/// A floor as a feature: the outline that a person accepted, without heights; of a floor that has none the
/// geometry is null.
nlohmann::ordered_json zone_json(const Floor& floor, const Building& building);

/// Each floor of every building. errors: those of the store
Result<void> each_zone(PlaceStore& places, const std::function<void(const Floor&, const Building&)>& take);

/// Around an outline; nothing without one.
std::optional<LonLatBox> bounds_of(const nlohmann::ordered_json& zone);

}  // namespace anchord::api
