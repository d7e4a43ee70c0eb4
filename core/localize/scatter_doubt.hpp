#pragma once

#include "core/localize/joint_model.hpp"

namespace anchord {

/// Widens the positions of a fit until one sigma reaches to where they would stand without the delays that
/// ranges may hide: those that scatter more than the anchor's quietest. A path that is not the straight one
/// makes ranges late by about as much as they scatter, as an exponential delay is. Where one side of a
/// building is so, place and bias take that mean in and no residual stays large. What is late alike on all
/// sides moves nothing: the bias takes it.
///
/// The scatter is that of a few ranges after each other about their own median, in which a wrong place, being
/// the same for all of them, has no part. Ranges with an error model hide nothing.
/// prior  what the fit was solved with
/// fit    its anchor_covariance grows; position, and what is said of the kit's bias, stay
/// Returns how many anchors became less certain by a tenth or more (root of the trace).
std::size_t add_scatter_doubt(const FlightRows& flight, const SharedPrior& prior,
                              const FlightOptions& options, JointFit& fit);

}  // namespace anchord
