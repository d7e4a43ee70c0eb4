#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/ports/drone.hpp"

namespace anchord::flight {

/// Names of the autopilot's parameters that a flight counts on; docs/flying.md has them with their reasons.
std::vector<std::string> flight_parameters(std::string_view autopilot);

struct ParameterCheck {
  bool complete{false};  ///< every one was answered, or is not known to this autopilot
  std::string wrong;     ///< what is set otherwise, with value and what is wanted; empty: nothing
};
ParameterCheck check_parameters(const DroneStatus& drone);

}  // namespace anchord::flight
