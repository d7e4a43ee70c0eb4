#pragma once

#include <nlohmann/json_fwd.hpp>

#include "api/anchors/anchor_goals.hpp"
#include "core/types/anchor.hpp"

namespace anchord::api {

/// `goals`: of its anchors, which are told where they are given.
nlohmann::ordered_json calibration_json(const Calibration& calibration, const AnchorGoals* goals);
nlohmann::ordered_json revision_json(const Revision& revision);

}  // namespace anchord::api
