#include "core/localize/weighed_row.hpp"

#include <algorithm>
#include <cmath>

#include "core/localize/error_model_likelihood.hpp"

namespace anchord {

double row_variance_m2(const JointLine& line, const AnchorBlock& block, double scale_m) {
  return scale_m * scale_m + std::max(line.position_variance_m2 - block.usual_position_variance_m2, 0.0);
}

WeighedRow weighed_row(const JointRow& row, const JointLine& line, const AnchorBlock& block, double scale_m,
                       const FlightOptions& options) {
  if (row.error_model) {
    const auto value = error_model_value(*row.error_model, line.residual_m, line.position_variance_m2);
    if (!(value.information_per_m2 > 0)) return {};
    return {value.information_per_m2 / block.kappa, value.score_per_m / value.information_per_m2};
  }
  const double variance_m2 = row_variance_m2(line, block, scale_m);
  const double robust = robust_weight(line.residual_m / std::sqrt(variance_m2), options);
  return {robust / (variance_m2 * block.kappa), line.residual_m};
}

}  // namespace anchord
