#include "core/localize/own_delay.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/base/median.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

// Made anchors with 0.6 m of their own reach 1.2 sigma and more; of good ones none reaches 0.2 m, real ones
// out of rooms 0.42 m at 0.95 sigma, real ones in rooms 0.4 m.
constexpr double k_least_delay_m = 0.25, k_least_z = 1.1;
constexpr double k_room_m = 5.0, k_least_room_delay_m = 0.5, k_least_room_z = 0.75;

bool in_room(const AnchorRows& anchor) {
  std::vector<double> distances_m;
  for (const JointRow& row : anchor.rows) distances_m.push_back(row.distance_m);
  return distances_m.empty() || upper_median(distances_m) < k_room_m;
}

}  // namespace

std::optional<OwnDelay> own_delay(const JointFit& fit, std::size_t index, const FlightOptions& options) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const double prior = 1.0 / (options.delay_prior_m * options.delay_prior_m);
  Eigen::Matrix3d place = block.own.topLeftCorner<3, 3>();
  place.diagonal().array() += 1e-6 * place.diagonal().maxCoeff() + 1e-12;
  const Eigen::Vector3d by_delay = place.ldlt().solve(block.own.topRightCorner<3, 1>());
  const double shown = block.own(3, 3) - prior - block.own.topRightCorner<3, 1>().dot(by_delay);
  if (!(shown > 1e-6)) return std::nullopt;
  // At the solution the ranges hold against the prior's pull, prior * delay.
  const double more_m = fit.state.anchors[index].delay_m * prior / shown;
  OwnDelay out;
  out.delay_m = fit.state.anchors[index].delay_m + more_m;
  out.sigma_m = 1.0 / std::sqrt(shown);
  out.moved << -more_m * by_delay, more_m;
  return out;
}

double own_delay_limit_m(const OwnDelay& own, const AnchorRows& anchor) {
  return in_room(anchor) ? std::max(k_least_room_delay_m, k_least_room_z * own.sigma_m)
                         : std::max(k_least_delay_m, k_least_z * own.sigma_m);
}

std::size_t add_own_delay_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit) {
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    if (!fit.state.anchors[i].active || mostly_modelled(flight.anchors[i])) continue;
    const auto own = own_delay(fit, i, options);
    if (!own || std::abs(own->delay_m) <= own_delay_limit_m(*own, flight.anchors[i])) continue;
    const Eigen::Matrix4d before_m2 = fit.anchor_covariance[i];
    reach(own->moved, options.dims, fit.anchor_covariance[i]);
    n_wider += much_wider(fit.anchor_covariance[i], before_m2, options.dims) ? 1 : 0;
  }
  return n_wider;
}

std::optional<Gate> own_delay_gate(const FlightRows& flight, const JointFit& fit, std::size_t index,
                                   const FlightOptions& options) {
  if (in_room(flight.anchors[index])) return std::nullopt;
  const auto own = own_delay(fit, index, options);
  if (!own) return std::nullopt;
  const double limit_m = own_delay_limit_m(*own, flight.anchors[index]);
  const bool passed = std::abs(own->delay_m) <= limit_m;
  char text[320];
  if (!passed)
    std::snprintf(text, sizeof text,
                  "its ranges fit better if they are %.2f m too %s, unlike those of the other anchors (sigma "
                  "%.2f m), which would put it %.2f m away: check its antenna delay, cable and firmware, or "
                  "look for a wall before it",
                  std::abs(own->delay_m), own->delay_m > 0 ? "long" : "short", own->sigma_m,
                  own->moved.head<3>().norm());
  else
    std::snprintf(text, sizeof text, "a range bias of its own would be %+.2f m (sigma %.2f m)", own->delay_m,
                  own->sigma_m);
  return Gate{"own_delay", std::abs(own->delay_m), limit_m, passed, text};
}

bool mostly_modelled(const AnchorRows& anchor) {
  const auto n = std::ranges::count_if(anchor.rows, [](const JointRow& row) { return row.error_model; });
  return 2 * static_cast<std::size_t>(n) >= anchor.rows.size();
}

}  // namespace anchord
