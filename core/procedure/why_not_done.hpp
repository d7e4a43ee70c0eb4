#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string>

#include "core/procedure/exit_rule.hpp"
#include "core/types/estimate.hpp"

namespace anchord::procedure {

/// Why an anchor is not done yet, for the operator: a mirror, a flat flight, seen from one side, too many
/// refused ranges, height and bias not told apart, or simply not accurate enough yet. The first that holds,
/// with its numbers. points  where it was ranged, metres of the estimate's frame
std::string why_not_done(const std::optional<Estimate>& estimate, std::span<const Eigen::Vector3d> points,
                         const ExitRule& rule);

}  // namespace anchord::procedure
