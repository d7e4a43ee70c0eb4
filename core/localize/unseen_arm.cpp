#include "core/localize/unseen_arm.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <string>

#include "core/localize/chi_square.hpp"
#include "core/localize/flight_checks.hpp"
#include "core/localize/joint_lines.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr int k_directions = 24;  // of the error in the body, over half a turn: the rest is its opposite
// Sigmas of the flight below which an error of the arm passes. Solved again with the arm free a flight tells
// more than this linear step: what is found beyond k_arm_z there is beyond about three here.
constexpr double k_unseen_z = 3.0;
constexpr double k_course_s = 0.5;     // the course is that of a second
constexpr double k_least_way_m = 0.1;  // slower than 0.1 m/s there is no course

using AnchorByArm = Eigen::Matrix<double, 4, 2>;
/// For each heading that is asked, for each anchor.
using HeadingResponses = std::vector<std::vector<AnchorByArm>>;

/// How a fit with the arm held answers to an arm that is wrong, per metre forward and left.
struct ArmResponse {
  Eigen::Matrix<double, k_shared_size, 2> shared;
  Eigen::Matrix2d information_per_m2;  ///< what the flight says about the arm
  std::vector<AnchorByArm> anchors{};
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

/// Headings that an aircraft without attitude may have had, about a constant.
enum class Heading : std::uint8_t { along_course, to_middle };

std::optional<Eigen::Vector3d> place_at(const TagTrack& track, double t_s) {
  const TrackInterval in = track.interval_at(t_s);
  if (in.refused != TrackRefusal::none) return std::nullopt;
  const double interval_s = in.later->t_s - in.before->t_s;
  const double share = interval_s > 0 ? (t_s - in.before->t_s) / interval_s : 0.0;
  return (1.0 - share) * in.before->position_m + share * in.later->position_m;
}

/// Direction in the plane at an instant; zero where there is none. middle_m  of the track
Eigen::Vector3d direction_at(const FlightRows& flight, Heading heading, const Eigen::Vector3d& antenna_m,
                             const Eigen::Vector3d& middle_m, double t_s) {
  Eigen::Vector3d way = middle_m - antenna_m;
  if (heading == Heading::along_course) {
    const auto before = place_at(flight.track, t_s - k_course_s);
    const auto after = place_at(flight.track, t_s + k_course_s);
    if (!before || !after) return Eigen::Vector3d::Zero();
    way = *after - *before;
  }
  way.z() = 0;
  const double length_m = way.norm();
  return length_m > k_least_way_m ? Eigen::Vector3d(way / length_m) : Eigen::Vector3d::Zero();
}

/// How the fit would answer to an arm that turned with a heading which the track does not have: every anchor,
/// for each heading that is asked.
HeadingResponses responses_without_heading(const FlightRows& flight, const JointFit& fit,
                                           const SharedPrior& prior, const FlightOptions& options) {
  constexpr std::array k_headings{Heading::along_course, Heading::to_middle};
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const TrackPose& pose : flight.track.poses()) middle_m += pose.position_m;
  middle_m /= static_cast<double>(flight.track.poses().size());
  const std::size_t n_anchors = flight.anchors.size();
  HeadingResponses responses(k_headings.size(), std::vector<AnchorByArm>(n_anchors, AnchorByArm::Zero()));
  using SharedByArm = Eigen::Matrix<double, k_shared_size, 2>;
  std::array<SharedByArm, k_headings.size()> shared;
  shared.fill(SharedByArm::Zero());
  for (std::size_t i = 0; i < n_anchors; ++i) {
    const AnchorBlock& block = fit.normal.anchors[i];
    if (!fit.state.anchors[i].active || !(block.scale_m > 0)) continue;
    const JointLines lines(flight.track, flight.anchors[i].rows, fit.state.shared, fit.state.anchors[i]);
    for (std::size_t k = 0; k < lines.size(); ++k) {
      const JointRow& row = *lines.rows()[k];
      const JointLine line = lines.line(k);
      const double weight = robust_weight(line.residual_m / block.scale_m, options) /
                            (block.kappa * block.scale_m * block.scale_m);
      // By the antenna the range changes as by the anchor, with the other sign.
      const Eigen::Vector3d by_antenna = -line.by_anchor.head<3>();
      for (std::size_t h = 0; h < k_headings.size(); ++h) {
        const Eigen::Vector3d forward = direction_at(flight, k_headings[h], line.antenna_m, middle_m,
                                                     row.t_s + fit.state.shared[k_shared_lag]);
        const Eigen::RowVector2d by_arm(by_antenna.dot(forward),
                                        by_antenna.dot(Eigen::Vector3d::UnitZ().cross(forward)));
        responses[h][i] += weight * line.by_anchor * by_arm;
        shared[h] += weight * line.by_shared * by_arm;
      }
    }
    for (std::size_t h = 0; h < k_headings.size(); ++h)
      shared[h] -= block.shared.transpose() * block.own_inverse * responses[h][i];
  }
  for (std::size_t h = 0; h < k_headings.size(); ++h) {
    const SharedByArm moved = (fit.normal.reduced + prior.information).ldlt().solve(shared[h]);
    for (std::size_t i = 0; i < n_anchors; ++i) {
      const AnchorBlock& block = fit.normal.anchors[i];
      responses[h][i] = block.own_inverse * (responses[h][i] - block.shared * moved);
    }
  }
  return responses;
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

Eigen::Vector2d way_of(int direction) {
  const double angle_rad = direction * std::numbers::pi / k_directions;
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

/// Moves of one anchor by the errors that nothing shows, one a column.
std::vector<Eigen::Vector3d> moves_of(const AnchorByArm& per_metre, const ArmResponse& arm) {
  std::vector<Eigen::Vector3d> moves;
  for (int k = 0; k < k_directions; ++k)
    moves.emplace_back((per_metre * unseen_m(way_of(k), arm.information_per_m2)).head<3>());
  return moves;
}

/// The same by an arm across that was not applied: at one heading its length in the plane, at one that
/// turns also the height, which a range from the side hardly tells.
std::vector<Eigen::Vector3d> moves_of(std::size_t anchor, const HeadingResponses& responses,
                                      double unapplied_m) {
  std::vector<Eigen::Vector3d> moves;
  for (int k = 0; k < k_directions; ++k) {
    const Eigen::Vector2d arm_m = unapplied_m * way_of(k);
    moves.emplace_back(arm_m.x(), arm_m.y(), 0.0);
    for (const auto& of : responses) moves.emplace_back((of[anchor] * arm_m).head<3>());
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
        "the track has no heading, so %.2f m of the horizontal lever arm are not applied and may move it by "
        "%.2f m: record the attitude, or mount the tag below the antenna",
        unapplied, worst.moved_m);
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
  const double sigma_m = *options.lever_arm_sigma_m;
  const bool has_attitude = flight.track.has_attitude();
  const ArmResponse arm = response_of(fit, prior);
  const auto turning =
      has_attitude ? HeadingResponses{} : responses_without_heading(flight, fit, prior, options);
  const Eigen::Matrix4d in_plane_m2 = sigma_m * sigma_m * Eigen::Vector4d(1, 1, 0, 0).asDiagonal();
  for (std::size_t i = 0; i < fit.anchor_covariance.size(); ++i) {
    const Eigen::Matrix4d before_m2 = fit.anchor_covariance[i];
    Eigen::Matrix4d& now_m2 = fit.anchor_covariance[i];
    if (has_attitude)
      now_m2 += sigma_m * sigma_m * (arm.anchors[i] * arm.anchors[i].transpose());
    else
      now_m2 += in_plane_m2;
    for (const auto& of : turning) {
      for (int k = 0; k < k_directions; ++k) reach(of[i] * (sigma_m * way_of(k)), options.dims, now_m2);
    }
    fit.arm_covariance_m2.emplace_back((now_m2 - before_m2).topLeftCorner<3, 3>());
  }
}

std::vector<Gate> unseen_arm_gates(const FlightRows& flight, const JointFit& fit, const SharedPrior& prior,
                                   const FlightOptions& options) {
  if (options.lever_across_prior_m > 0 || flight.point == TrackPoint::tag_antenna) return {};
  const double unapplied = flight.track.has_attitude() ? 0.0 : unapplied_m(flight);
  // How well an arm is measured says nothing of one that is not applied.
  if (unapplied <= 0 && (options.lever_arm_sigma_m || !flight.track.has_attitude())) return {};
  const ArmResponse arm = response_of(fit, prior);
  const auto turning =
      unapplied > 0 ? responses_without_heading(flight, fit, prior, options) : HeadingResponses{};
  std::vector<Gate> gates;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    Eigen::Matrix3d covariance_m2 = fit.anchor_covariance[i].topLeftCorner<3, 3>();
    covariance_m2.diagonal().array() += options.floor_sigma_m * options.floor_sigma_m;
    const auto moves = unapplied > 0 ? moves_of(i, turning, unapplied) : moves_of(arm.anchors[i], arm);
    const Reach worst = worst_of(moves, covariance_m2, options.dims);
    gates.push_back({"unseen_arm", worst.moved_m, worst.regions > 0 ? worst.moved_m / worst.regions : 0.0,
                     worst.regions <= 1.0, why(worst, unapplied)});
  }
  return gates;
}

}  // namespace anchord
