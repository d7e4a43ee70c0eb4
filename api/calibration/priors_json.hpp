#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "api/kit/reader.hpp"
#include "core/localize/flight_options.hpp"

namespace anchord::api {

/// Priors about the side of the wall, as POST /calibrations and `anchord solve --priors` take them
/// (docs/formats.md). Metres are those of the answers. What is wrong is appended to `errors`.
void read_priors(const nlohmann::json& value, const std::string& base, FlightOptions& options,
                 std::vector<FieldError>& errors);

}  // namespace anchord::api
