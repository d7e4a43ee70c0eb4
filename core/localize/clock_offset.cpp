#include "core/localize/clock_offset.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <vector>

#include "core/base/median.hpp"

namespace anchord {
namespace {

constexpr double k_most_s = 60.0, k_step_s = 0.25, k_fine_step_s = 0.05;
constexpr double k_least_s = 1.0;         // the fit finds less by itself
constexpr double k_least_misfit_m = 0.2;  // below, the ranges fit where they are
constexpr double k_misfit_share = 0.4;
constexpr double k_placed_share = 0.9;  // few ranges fit everywhere
constexpr std::size_t k_most_rows = 80, k_least_rows = 24;
constexpr double k_gps_ahead_s = 18.0, k_near_gps_s = 1.0;  // since 2017; the lag of a kit is within a second

/// How the ranges of a flight fit at one offset of their times.
struct ClockFit {
  std::size_t n_placed{0};
  double misfit_m{0};  ///< median over the anchors; 0 where none can be asked
};

/// Misfit of the closed form: |p|^2 - r^2 = 2 p.x - c, linear in x and c, as metres of the range.
std::optional<double> misfit_of(const std::vector<Eigen::Vector3d>& places_m,
                                const std::vector<double>& distances_m) {
  if (places_m.size() < k_least_rows) return std::nullopt;
  Eigen::Vector3d middle_m = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& place_m : places_m) middle_m += place_m;
  middle_m /= static_cast<double>(places_m.size());
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const auto line = [&](std::size_t i) {
    const Eigen::Vector3d from_m = places_m[i] - middle_m;
    return std::pair(Eigen::Vector4d(2 * from_m.x(), 2 * from_m.y(), 2 * from_m.z(), -1.0),
                     from_m.squaredNorm() - distances_m[i] * distances_m[i]);
  };
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    const auto [by, value] = line(i);
    normal += by * by.transpose();
    right += by * value;
  }
  normal.diagonal().array() += 1e-9 * normal.trace();  // a flat track says nothing of one direction
  const Eigen::Vector4d solution = normal.ldlt().solve(right);
  std::vector<double> misfits_m;
  for (std::size_t i = 0; i < places_m.size(); ++i) {
    const auto [by, value] = line(i);
    misfits_m.push_back(std::abs(value - by.dot(solution)) / (2 * distances_m[i]));
  }
  return 1.4826 * upper_median(misfits_m);
}

ClockFit clock_fit(const FlightRows& flight, double lag_s) {
  ClockFit out;
  std::vector<double> misfits_m;
  for (const AnchorRows& anchor : flight.anchors) {
    std::vector<Eigen::Vector3d> places_m;
    std::vector<double> distances_m;
    const std::size_t n = std::min(anchor.rows.size(), k_most_rows);
    for (std::size_t i = 0; i < n; ++i) {
      const JointRow& row = anchor.rows[i * anchor.rows.size() / n];
      const TagPoint point = flight.track.at(row.t_s + lag_s, row.lever_arm_body_m);
      if (point.refused != TrackRefusal::none || !(row.distance_m > 0)) continue;
      places_m.push_back(point.position_m);
      distances_m.push_back(row.distance_m);
    }
    out.n_placed += places_m.size();
    if (const auto misfit_m = misfit_of(places_m, distances_m)) misfits_m.push_back(*misfit_m);
  }
  if (!misfits_m.empty()) out.misfit_m = upper_median(misfits_m);
  return out;
}

std::string why(double offset_s, double misfit_m, double as_solved_m) {
  char text[400];
  std::snprintf(
      text, sizeof text,
      "the ranges fit the track %.1f s %s their times (misfit %.2f m; as solved %.2f m): the clock of the "
      "ranges or of the track is off%s: correct the times of one of them and solve again",
      std::abs(offset_s), offset_s < 0 ? "before" : "after", misfit_m, as_solved_m,
      std::abs(std::abs(offset_s) - k_gps_ahead_s) < k_near_gps_s ? " (GPS time is 18 s ahead of UTC)" : "");
  return text;
}

}  // namespace

std::optional<Gate> check_clock(const FlightRows& flight, const JointFit& fit) {
  const ClockFit solved = clock_fit(flight, fit.state.shared[k_shared_lag]);
  if (solved.misfit_m <= k_least_misfit_m) return std::nullopt;
  double best_s = 0, best_m = k_misfit_share * solved.misfit_m;
  const auto ask = [&](double offset_s) {
    const ClockFit there = clock_fit(flight, offset_s);
    const bool placed =
        static_cast<double>(there.n_placed) >= k_placed_share * static_cast<double>(solved.n_placed);
    if (!placed || there.misfit_m <= 0 || there.misfit_m >= best_m) return;
    best_s = offset_s;
    best_m = there.misfit_m;
  };
  const int n_steps = static_cast<int>(k_most_s / k_step_s);
  for (int k = -n_steps; k <= n_steps; ++k) {
    if (std::abs(k) * k_step_s >= k_least_s) ask(k * k_step_s);
  }
  if (best_s == 0) return std::nullopt;
  const double coarse_s = best_s;
  for (double off_s = -k_step_s + k_fine_step_s; off_s < k_step_s; off_s += k_fine_step_s)
    ask(coarse_s + off_s);
  return Gate{"clock", std::abs(best_s), k_least_s, false, why(best_s, best_m, solved.misfit_m)};
}

}  // namespace anchord
