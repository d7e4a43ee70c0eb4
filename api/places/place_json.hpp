#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/types/place.hpp"

namespace anchord::api {

std::string etag(const Building& building);
std::string etag(const Floor& floor);

nlohmann::ordered_json building_json(const Building& building);
/// Without its walls and the proposal, which have addresses of their own.
nlohmann::ordered_json floor_json(const Floor& floor);

}  // namespace anchord::api
