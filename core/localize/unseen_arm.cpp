#include "core/localize/unseen_arm.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>

#include "core/localize/chi_square.hpp"
#include "core/localize/flight_checks.hpp"

namespace anchord {
namespace {

constexpr int k_directions = 24;  // of the error in the body, over half a turn: the rest is its opposite
// Sigmas of the flight below which an error of the arm passes. Solved again with the arm free a flight tells
// more than this linear step: what is found beyond k_arm_z there is beyond about three here.
constexpr double k_unseen_z = 3.0;

/// How a fit with the arm held answers to an arm that is wrong, per metre forward and left.
struct ArmResponse {
  Eigen::Matrix<double, k_shared_size, 2> shared;
  Eigen::Matrix2d information_per_m2;  ///< what the flight says about the arm
  std::vector<Eigen::Matrix<double, 4, 2>> anchors{};
};

ArmResponse response_of(const JointFit& fit, const SharedPrior& prior) {
  ArmResponse out;
  const SharedMatrix& reduced = fit.normal.reduced;
  out.shared = (reduced + prior.information).ldlt().solve(reduced.middleCols<2>(k_shared_forward));
  out.information_per_m2 = reduced.block<2, 2>(k_shared_forward, k_shared_forward) -
                           reduced.middleRows<2>(k_shared_forward) * out.shared;
  for (const AnchorBlock& block : fit.normal.anchors)
    out.anchors.emplace_back(block.own_inverse *
                             (block.shared.middleCols<2>(k_shared_forward) - block.shared * out.shared));
  return out;
}

/// The largest error in a direction of the body that the flight would not show.
Eigen::Vector2d unseen_m(const Eigen::Vector2d& way, const Eigen::Matrix2d& information_per_m2) {
  const double information = way.dot(information_per_m2 * way);
  return way *
         (information > 0 ? std::min(k_arm_asked_m, k_unseen_z / std::sqrt(information)) : k_arm_asked_m);
}

/// Arm across that a track without attitude could not apply.
double unapplied_m(const FlightRows& flight) {
  double most_m = 0;
  for (const AnchorRows& anchor : flight.anchors) {
    for (const JointRow& row : anchor.rows) most_m = std::max(most_m, row.lever_arm_body_m.head<2>().norm());
  }
  return most_m;
}

/// Moves of one anchor by the errors that nothing shows, one a column.
std::vector<Eigen::Vector3d> moves_of(const Eigen::Matrix<double, 4, 2>& per_metre, const ArmResponse& arm,
                                      double unapplied) {
  std::vector<Eigen::Vector3d> moves;
  for (int k = 0; k < k_directions; ++k) {
    const double angle_rad = k * std::numbers::pi / k_directions;
    const Eigen::Vector2d way(std::cos(angle_rad), std::sin(angle_rad));
    if (unapplied > 0)
      moves.emplace_back(unapplied * way.x(), unapplied * way.y(), 0.0);
    else
      moves.emplace_back((per_metre * unseen_m(way, arm.information_per_m2)).head<3>());
  }
  return moves;
}

/// The worst move in units of the 95 % region, and its length.
struct Reach {
  double moved_m{}, regions{};
};
Reach worst_of(const std::vector<Eigen::Vector3d>& moves, const Eigen::Matrix3d& covariance_m2, Dims dims) {
  const int n = dims == Dims::two ? 2 : 3;
  const double limit = dims == Dims::two ? 5.991464547107979 : 7.814727903251179;
  const Eigen::LDLT<Eigen::MatrixXd> metric(covariance_m2.topLeftCorner(n, n));
  Reach worst;
  for (const Eigen::Vector3d& move : moves) {
    const double regions = std::sqrt(std::max(move.head(n).dot(metric.solve(move.head(n))), 0.0) / limit);
    if (regions >= worst.regions) worst = {move.head(n).norm(), regions};
  }
  return worst;
}

std::string why(const Reach& worst, double unapplied) {
  char text[320];
  if (unapplied > 0)
    std::snprintf(
        text, sizeof text,
        "the track has no heading, so %.2f m of the horizontal lever arm are not applied: record the "
        "attitude, or mount the tag below the antenna",
        unapplied);
  else if (worst.regions <= 1.0)
    std::snprintf(text, sizeof text,
                  "a lever arm that is wrong by up to %.1f m shows in the ranges, or moves it by at most "
                  "%.2f m, within its region",
                  k_arm_asked_m, worst.moved_m);
  else
    std::snprintf(
        text, sizeof text,
        "a lever arm that is wrong by up to %.1f m may move it by %.2f m, out of its region, without showing "
        "in any range: fly 20 s or more with the heading a quarter turn away, or declare how "
        "well the arm was measured (lever_arm_sigma_m)",
        k_arm_asked_m, worst.moved_m);
  return text;
}

}  // namespace

void add_arm_doubt(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options,
                   JointFit& fit) {
  if (!options.lever_arm_sigma_m) return;
  const ArmResponse arm = response_of(fit, prior);
  const double variance_m2 = *options.lever_arm_sigma_m * *options.lever_arm_sigma_m;
  const Eigen::Matrix4d in_plane = Eigen::Vector4d(1, 1, 0, 0).asDiagonal();
  for (std::size_t i = 0; i < fit.anchor_covariance.size(); ++i) {
    const Eigen::Matrix4d arm_m2 =
        variance_m2 * (flight.track.has_attitude()
                           ? Eigen::Matrix4d(arm.anchors[i] * arm.anchors[i].transpose())
                           : in_plane);
    fit.anchor_covariance[i] += arm_m2;
    fit.arm_covariance_m2.emplace_back(arm_m2.topLeftCorner<3, 3>());
  }
}

std::vector<Gate> unseen_arm_gates(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                   const FlightOptions& options) {
  if (options.lever_across_prior_m > 0 || flight.point == TrackPoint::tag_antenna) return {};
  const double unapplied = flight.track.has_attitude() ? 0.0 : unapplied_m(flight);
  // How well an arm is measured says nothing of one that is not applied.
  if (unapplied <= 0 && (options.lever_arm_sigma_m || !flight.track.has_attitude())) return {};
  const ArmResponse arm = response_of(fit, prior);
  std::vector<Gate> gates;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    Eigen::Matrix3d covariance_m2 = fit.anchor_covariance[i].topLeftCorner<3, 3>();
    covariance_m2.diagonal().array() += options.floor_sigma_m * options.floor_sigma_m;
    const Reach worst = worst_of(moves_of(arm.anchors[i], arm, unapplied), covariance_m2, options.dims);
    gates.push_back({"unseen_arm", worst.moved_m, worst.regions > 0 ? worst.moved_m / worst.regions : 0.0,
                     worst.regions <= 1.0, why(worst, unapplied)});
  }
  return gates;
}

}  // namespace anchord
