#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/types/anchor.hpp"

namespace anchord::api {

nlohmann::ordered_json calibration_json(const Calibration& calibration, bool with_anchors);
nlohmann::ordered_json revision_json(const Revision& revision);

}  // namespace anchord::api
