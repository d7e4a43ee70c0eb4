#include "core/localize/sector_doubt.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>
#include <vector>

#include "core/localize/joint_lines.hpp"
#include "core/localize/weighed_row.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_bins = 24;    // of 15 degrees
constexpr std::size_t k_levels = 12;  // of as many ranges each
constexpr double k_least_climb_m = 0.5;
constexpr int k_least_ranges = 60;
constexpr double k_least_share = 0.1, k_most_share = 0.9;  // of the ranges, in the sector
constexpr double k_unit_sigma_m = 0.3;  // of the unit delay, which takes in what the bias has of the delay
constexpr double k_place_sigma_m = 5.0;
// Of 488 made anchors without any delay one in eight reaches the first, one in twenty twice the second; real
// flights reach 1.9, but by 0.15 m, which their regions hold.
constexpr double k_doubted_gain = 0.5, k_believed_gain = 1.0;
// Of 238 anchors of made flights without any delay none reaches 0.6. Real radios do, by what their antennas
// have of a pattern (0.06 to 0.15 m); their regions hold that.
constexpr double k_doubted_level_gain = 1.5, k_believed_level_gain = 2.5;

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
/// The ranges of an anchor, each in the bin that `bin_of` names for the line to its antenna.
template <class BinOf>
std::vector<BinSums> binned(const JointLines& lines, const FlightOptions& options, double scale_m,
                            std::size_t n_bins, const BinOf& bin_of) {
  const double wide_m = k_wide_scales * scale_m;
  std::vector<BinSums> bins(n_bins);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    if (lines.rows()[i]->error_model) continue;
    const JointLine at = lines.line(i);
    const double size_m = std::abs(at.residual_m);
    const double weight = size_m <= wide_m ? 1.0 : wide_m * wide_m / (size_m * size_m);
    BinSums& bin = bins[bin_of(at)];
    Vector5 by;
    by << at.by_anchor, 1.0;
    bin.normal.noalias() += weight * by * by.transpose();
    bin.pull += weight * at.residual_m * by;
    bin.square_m2 += weight * at.residual_m * at.residual_m;
    bin.kept += robust_weight(at.residual_m / scale_m, options);
    ++bin.n;
  }
  return bins;
}

JointLines lines_of(const FlightRows& flight, const JointFit& fit, std::size_t index) {
  return {flight.track, flight.anchors[index].rows, fit.state.shared, fit.state.anchors[index]};
}

std::vector<BinSums> by_bearing(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                                std::size_t index) {
  const Eigen::Vector3d& anchor_m = fit.state.anchors[index].position_m;
  return binned(lines_of(flight, fit, index), options, fit.normal.anchors[index].scale_m, k_bins,
                [&](const JointLine& at) {
                  const Eigen::Vector3d ray = at.antenna_m - anchor_m;
                  const double turns = std::atan2(ray.y(), ray.x()) / (2 * std::numbers::pi) + 0.5;
                  return std::min(static_cast<std::size_t>(turns * k_bins), k_bins - 1);
                });
}

/// By the height of the tag, in steps of as many ranges each; empty: too little of a climb to tell any from
/// the others.
std::vector<BinSums> by_level(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                              std::size_t index) {
  const JointLines lines = lines_of(flight, fit, index);
  std::vector<double> heights_m;
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (!lines.rows()[i]->error_model) heights_m.push_back(lines.line(i).antenna_m.z());
  std::ranges::sort(heights_m);
  if (heights_m.empty() || heights_m.back() - heights_m.front() < k_least_climb_m) return {};
  std::vector<double> ends_m;
  for (std::size_t k = 1; k < k_levels; ++k) ends_m.push_back(heights_m[k * heights_m.size() / k_levels]);
  return binned(lines, options, fit.normal.anchors[index].scale_m, k_levels, [&](const JointLine& at) {
    return static_cast<std::size_t>(std::ranges::upper_bound(ends_m, at.antenna_m.z()) - ends_m.begin());
  });
}

/// The part of the ranges that is most likely late.
struct LateSide {
  double delay_m{}, gain{};
  double kept{};  ///< part of the delay that the fit has in it: 0 where its loss rejects these ranges
  Eigen::Vector4d moved{Eigen::Vector4d::Zero()};  ///< to where place and unit delay would be without
};

/// Asks one part of an anchor's ranges after the other for a delay of its own, place and unit delay free.
class LateSearch {
 public:
  LateSearch(std::span<const BinSums> bins, const AnchorBlock& block) : block_(block) {
    for (const BinSums& bin : bins) all_ += bin;
    Eigen::Matrix4d own = all_.normal.topLeftCorner<4, 4>();
    const double scale_m2 = block.scale_m * block.scale_m;
    own.diagonal().head<3>().array() += scale_m2 / (k_place_sigma_m * k_place_sigma_m);
    own(3, 3) += scale_m2 / (k_unit_sigma_m * k_unit_sigma_m);
    inverse_ = own.inverse();
    pull_ = all_.pull.head<4>();
    least_m2_ = without_m2_ = all_.square_m2 - pull_.dot(inverse_ * pull_);
  }
  bool has_enough() const { return all_.n >= k_least_ranges; }
  void ask(const BinSums& part) {
    const double weight = part.normal(4, 4), share = weight / all_.normal(4, 4);
    if (share < k_least_share || share > k_most_share) return;
    const Eigen::Vector4d with = part.normal.topRightCorner<4, 1>();
    const double told = weight - with.dot(inverse_ * with);
    const double delay_m = (part.pull[4] - with.dot(inverse_ * pull_)) / told;
    const double left_m2 = without_m2_ - delay_m * delay_m * told;
    if (!(told > 1e-6 * weight) || !(delay_m > 0) || !(left_m2 < least_m2_)) return;
    least_m2_ = left_m2;
    best_.delay_m = delay_m;
    best_.kept = std::min(1.0, part.kept * (all_.normal(4, 4) - weight) /
                                   std::max(weight * (all_.kept - part.kept), 1e-9 * weight));
    best_.moved = inverse_ * (pull_ - with * delay_m);
  }
  LateSide found() const {
    LateSide out = best_;
    const double floor_m2 = 1e-6 * without_m2_;
    if (without_m2_ > 0)
      out.gain =
          0.5 * all_.normal(4, 4) / block_.kappa * std::log(without_m2_ / std::max(least_m2_, floor_m2));
    return out;
  }

 private:
  const AnchorBlock& block_;
  BinSums all_;
  Eigen::Matrix4d inverse_;
  Eigen::Vector4d pull_;
  double without_m2_{}, least_m2_{};
  LateSide best_;
};

/// Of every sector of the bearing.
LateSide late_sector(std::span<const BinSums> bearings, const AnchorBlock& block) {
  LateSearch search(bearings, block);
  if (!search.has_enough()) return {};
  for (std::size_t from = 0; from < bearings.size(); ++from) {
    BinSums sector;
    for (std::size_t length = 1; length < bearings.size(); ++length) {
      sector += bearings[(from + length - 1) % bearings.size()];
      search.ask(sector);
    }
  }
  return search.found();
}

/// Of all from some level up, and of all from one down.
LateSide late_level(std::span<const BinSums> levels, const AnchorBlock& block) {
  LateSearch search(levels, block);
  if (levels.empty() || !search.has_enough()) return {};
  BinSums below;
  for (std::size_t k = 0; k + 1 < levels.size(); ++k) {
    below += levels[k];
    search.ask(below);
    BinSums above;
    for (std::size_t i = k + 1; i < levels.size(); ++i) above += levels[i];
    search.ask(above);
  }
  return search.found();
}

/// How much of what was found is believed.
double share_of(const LateSide& side, double doubted, double believed) {
  if (!side.moved.allFinite()) return 0;
  return std::clamp((side.gain - doubted) / (believed - doubted), 0.0, 1.0);
}

/// Asks every anchor; how many became less certain.
template <class Widen>
std::size_t widen_each(const FlightRows& flight, Dims dims, JointFit& fit, const Widen& widen) {
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    const Eigen::Matrix4d before_m2 = fit.anchor_covariance[i];
    widen(i, fit.anchor_covariance[i]);
    n_wider += much_wider(fit.anchor_covariance[i], before_m2, dims) ? 1 : 0;
  }
  return n_wider;
}

}  // namespace

std::size_t add_sector_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit) {
  return widen_each(flight, options.dims, fit, [&](std::size_t i, Eigen::Matrix4d& covariance_m2) {
    const LateSide side = late_sector(by_bearing(flight, options, fit, i), fit.normal.anchors[i]);
    const double share = share_of(side, k_doubted_gain, k_believed_gain);
    if (!(share > 0)) return;
    reach(share * side.moved, options.dims, covariance_m2);
    widen_in_plane(
        share * std::max(side.moved.head<2>().norm(), 2 / std::numbers::pi * side.kept * side.delay_m),
        covariance_m2);
  });
}

std::size_t add_level_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit) {
  return widen_each(flight, options.dims, fit, [&](std::size_t i, Eigen::Matrix4d& covariance_m2) {
    const LateSide level = late_level(by_level(flight, options, fit, i), fit.normal.anchors[i]);
    const double share = share_of(level, k_doubted_level_gain, k_believed_level_gain);
    if (share > 0) reach({0, 0, share * level.moved[2], 0}, options.dims, covariance_m2);
  });
}

}  // namespace anchord
