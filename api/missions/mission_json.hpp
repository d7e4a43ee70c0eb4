#pragma once

#include <cstdint>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <vector>

#include "api/kit/problem.hpp"
#include "core/types/mission.hpp"

namespace anchord::api {

nlohmann::ordered_json mission_json(const Mission& mission, std::optional<std::uint64_t> n_ranges,
                                    std::optional<std::uint64_t> n_fixes);
/// Body of POST /missions. What is wrong goes to `errors`.
Mission read_mission(const nlohmann::json& body, std::vector<FieldError>& errors);

}  // namespace anchord::api
