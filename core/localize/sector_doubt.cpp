#include "core/localize/sector_doubt.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/localize/joint_lines.hpp"
#include "core/localize/weighed_row.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_bins = 24;  // of 15 degrees
constexpr int k_least_ranges = 60;
constexpr double k_least_share = 0.1, k_most_share = 0.9;  // of the ranges, in the sector
constexpr double k_unit_sigma_m = 0.3;  // of the unit delay, which takes in what the bias has of the delay
constexpr double k_place_sigma_m = 5.0;
// Of 488 made anchors without any delay one in eight reaches the first, one in twenty twice the second; real
// flights reach 1.9, but by 0.15 m, which their regions hold.
constexpr double k_doubted_gain = 0.5, k_believed_gain = 1.0;

using Matrix5 = Eigen::Matrix<double, 5, 5>;
using Vector5 = Eigen::Matrix<double, 5, 1>;

/// Normal equations of place and unit delay (4), and of a delay of these ranges alone (last).
struct BinSums {
  Matrix5 normal{Matrix5::Zero()};
  Vector5 pull{Vector5::Zero()};
  double square_m2{};
  double kept{};  ///< weight that the fit itself gives to these ranges
  int n{};
  BinSums& operator+=(const BinSums& o) {
    normal += o.normal;
    pull += o.pull;
    square_m2 += o.square_m2;
    kept += o.kept;
    n += o.n;
    return *this;
  }
};
using Bins = std::array<BinSums, k_bins>;

Bins by_bearing(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                std::size_t index) {
  const JointState::Anchor& anchor = fit.state.anchors[index];
  const double wide_m = k_wide_scales * fit.normal.anchors[index].scale_m;
  Bins bins{};
  const JointLines lines(flight.track, flight.anchors[index].rows, fit.state.shared, anchor);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines.rows()[i]->error_model) continue;
    const JointLine at = lines.line(i);
    const double size_m = std::abs(at.residual_m);
    const double weight = size_m <= wide_m ? 1.0 : wide_m * wide_m / (size_m * size_m);
    const Eigen::Vector3d ray = at.antenna_m - anchor.position_m;
    const double turns = std::atan2(ray.y(), ray.x()) / (2 * std::numbers::pi) + 0.5;
    BinSums& bin = bins[std::min(static_cast<std::size_t>(turns * k_bins), k_bins - 1)];
    Vector5 by;
    by << at.by_anchor, 1.0;
    bin.normal.noalias() += weight * by * by.transpose();
    bin.pull += weight * at.residual_m * by;
    bin.square_m2 += weight * at.residual_m * at.residual_m;
    bin.kept += robust_weight(at.residual_m / fit.normal.anchors[index].scale_m, options);
    ++bin.n;
  }
  return bins;
}

/// The sector whose ranges are most likely late.
struct LateSide {
  double delay_m{}, gain{};
  double kept{};  ///< part of the delay that the fit has in it: 0 where its loss rejects these ranges
  Eigen::Vector4d moved{Eigen::Vector4d::Zero()};  ///< to where place and unit delay would be without
};

LateSide late_side(const Bins& bins, const AnchorBlock& block) {
  BinSums all;
  for (const BinSums& bin : bins) all += bin;
  LateSide best;
  if (all.n < k_least_ranges) return best;
  Eigen::Matrix4d own = all.normal.topLeftCorner<4, 4>();
  const double scale_m2 = block.scale_m * block.scale_m;
  own.diagonal().head<3>().array() += scale_m2 / (k_place_sigma_m * k_place_sigma_m);
  own(3, 3) += scale_m2 / (k_unit_sigma_m * k_unit_sigma_m);
  const Eigen::Matrix4d inverse = own.inverse();
  const Eigen::Vector4d pull = all.pull.head<4>();
  const double without_m2 = all.square_m2 - pull.dot(inverse * pull);
  double least_m2 = without_m2;
  for (std::size_t from = 0; from < k_bins; ++from) {
    BinSums sector;
    for (std::size_t length = 1; length < k_bins; ++length) {
      sector += bins[(from + length - 1) % k_bins];
      const double weight = sector.normal(4, 4), share = weight / all.normal(4, 4);
      if (share < k_least_share || share > k_most_share) continue;
      const Eigen::Vector4d with = sector.normal.topRightCorner<4, 1>();
      const double told = weight - with.dot(inverse * with);
      const double delay_m = (sector.pull[4] - with.dot(inverse * pull)) / told;
      const double left_m2 = without_m2 - delay_m * delay_m * told;
      if (!(told > 1e-6 * weight) || !(delay_m > 0) || !(left_m2 < least_m2)) continue;
      least_m2 = left_m2;
      best.delay_m = delay_m;
      best.kept = std::min(1.0, sector.kept * (all.normal(4, 4) - weight) /
                                    std::max(weight * (all.kept - sector.kept), 1e-9 * weight));
      best.moved = inverse * (pull - with * delay_m);
    }
  }
  const double floor_m2 = 1e-6 * without_m2;
  if (without_m2 > 0)
    best.gain = 0.5 * all.normal(4, 4) / block.kappa * std::log(without_m2 / std::max(least_m2, floor_m2));
  return best;
}

}  // namespace

std::size_t add_sector_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit) {
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    const LateSide side = late_side(by_bearing(flight, options, fit, i), fit.normal.anchors[i]);
    const double share =
        std::clamp((side.gain - k_doubted_gain) / (k_believed_gain - k_doubted_gain), 0.0, 1.0);
    if (!(share > 0) || !side.moved.allFinite()) continue;
    Eigen::Matrix4d& covariance_m2 = fit.anchor_covariance[i];
    const Eigen::Matrix4d before_m2 = covariance_m2;
    reach(share * side.moved, options.dims, covariance_m2);
    widen_in_plane(
        share * std::max(side.moved.head<2>().norm(), 2 / std::numbers::pi * side.kept * side.delay_m),
        covariance_m2);
    n_wider += much_wider(covariance_m2, before_m2, options.dims) ? 1 : 0;
  }
  return n_wider;
}

}  // namespace anchord
