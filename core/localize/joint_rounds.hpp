#pragma once

#include "core/localize/joint_model.hpp"

namespace anchord {

/// The normal equations of the first round of solve_joint, whatever the prior.
JointNormal normal_at_start(const FlightRows& flight, const JointState& start, const FlightOptions& options);

/// solve_joint where those are known. errors: canceled
Result<JointFit> solve_joint_from(const FlightRows& flight, const JointState& start, JointNormal first,
                                  const SharedPrior& prior, const FlightOptions& options);

}  // namespace anchord
