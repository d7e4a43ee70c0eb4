#include "core/localize/scatter_doubt.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "core/base/median.hpp"
#include "core/localize/joint_lines.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_together = 12;  // ranges: some seconds, in which the direction hardly changes
constexpr std::size_t k_least_groups = 4;
constexpr double k_quiet_quantile = 0.25;
// Delay over median deviation from the median: 1.48 for a Gaussian's scale, 2.08 for the mean of an
// exponential one. Between them: where one side of the building is blocked, the first left 92 % of anchors
// inside their regions, the second widened those of honest flights beyond use.
constexpr double k_delay_per_deviation = 1.78;
constexpr double k_most = 2.8;  // residual scales: the default loss lets nothing count that is further off

/// One range in the normal equations.
struct Line {
  JointLine at;
  double weight_per_m2{};  ///< robust and tempered
  double hidden_m{};       ///< delay that it may have
};

/// Delay that would scatter so.
double mean_delay_m(std::span<const Line> lines) {
  std::vector<double> values_m;
  for (const Line& line : lines) values_m.push_back(line.at.residual_m);
  const double middle_m = upper_median(values_m);
  for (double& value_m : values_m) value_m = std::abs(value_m - middle_m);
  return k_delay_per_deviation * upper_median(values_m);
}

/// Ranges of one anchor without a prediction of a model, by time.
std::vector<Line> lines_of(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                           std::size_t index) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const double scale2 = block.scale_m * block.scale_m;
  const JointLines all(flight.track, flight.anchors[index].rows, fit.state.shared, fit.state.anchors[index]);
  std::vector<Line> lines;
  lines.reserve(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all.rows()[i]->error_model) continue;
    const JointLine at = all.line(i);
    const double variance_m2 =
        scale2 + std::max(at.position_variance_m2 - block.usual_position_variance_m2, 0.0);
    const double weight = robust_weight(at.residual_m / std::sqrt(variance_m2), options);
    lines.push_back({at, weight / (variance_m2 * block.kappa), 0.0});
  }
  return lines;
}

void find_hidden(std::span<Line> lines, double scale_m) {
  const std::size_t n_groups = lines.size() / k_together;
  if (n_groups < k_least_groups) return;
  std::vector<double> delays_m;
  for (std::size_t i = 0; i < n_groups; ++i)
    delays_m.push_back(mean_delay_m(lines.subspan(i * k_together, k_together)));
  std::vector<double> sorted_m = delays_m;
  std::ranges::sort(sorted_m);
  const double usual_m = sorted_m[static_cast<std::size_t>(k_quiet_quantile * static_cast<double>(n_groups))];
  for (std::size_t k = 0; k < lines.size(); ++k) {
    const double delay_m = delays_m[std::min(k / k_together, n_groups - 1)];
    lines[k].hidden_m =
        std::min(std::sqrt(std::max(delay_m * delay_m - usual_m * usual_m, 0.0)), k_most * scale_m);
  }
}

}  // namespace

std::size_t add_scatter_doubt(const FlightRows& flight, const SharedPrior& prior,
                              const FlightOptions& options, JointFit& fit) {
  // Were all hidden delays there, the gradient would be `own` and `pull`, and the solution would follow.
  std::vector<Eigen::Vector4d> own(flight.anchors.size(), Eigen::Vector4d::Zero());
  SharedVector pull = SharedVector::Zero();
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    const AnchorBlock& block = fit.normal.anchors[i];
    std::vector<Line> lines = lines_of(flight, options, fit, i);
    find_hidden(lines, block.scale_m);
    for (const Line& line : lines) {
      own[i] += line.weight_per_m2 * line.hidden_m * line.at.by_anchor;
      pull += line.weight_per_m2 * line.hidden_m * line.at.by_shared;
    }
    if (options.dims == Dims::two) own[i][2] = 0;
    pull -= block.shared.transpose() * (block.own_inverse * own[i]);
  }
  const SharedVector shared = (fit.normal.reduced + prior.information).ldlt().solve(pull);
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    const AnchorBlock& block = fit.normal.anchors[i];
    const Eigen::Vector4d moved = block.own_inverse * (own[i] - block.shared * shared);
    const Eigen::Matrix4d before_m2 = fit.anchor_covariance[i];
    reach(moved, options.dims, fit.anchor_covariance[i]);
    n_wider += much_wider(fit.anchor_covariance[i], before_m2, options.dims) ? 1 : 0;
  }
  return n_wider;
}

}  // namespace anchord
