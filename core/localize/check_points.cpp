#include "core/localize/check_points.hpp"

#include <Eigen/Dense>
#include <cmath>

#include "core/localize/chi_square.hpp"

namespace anchord {
namespace {

struct Test {
  double chi2{}, limit{}, p_value{};
};

Test test_of(const Eigen::Vector3d& delta_m, const Eigen::Matrix3d& covariance_m2, bool plane,
             const GateLimits& limits) {
  const double chi2 =
      plane ? delta_m.head<2>().dot(covariance_m2.topLeftCorner<2, 2>().ldlt().solve(delta_m.head<2>()))
            : delta_m.dot(covariance_m2.ldlt().solve(delta_m));
  return {chi2, chi2_limit(plane, limits), chi2_tail(chi2, plane)};
}

}  // namespace

CheckReport check_against(std::span<const CheckPoint> points, const GateLimits& limits) {
  CheckReport out;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero(), mean = Eigen::Matrix3d::Zero();
  Eigen::Vector3d weighted = Eigen::Vector3d::Zero();
  bool plane = false;
  for (const CheckPoint& point : points) {
    const Eigen::Vector3d delta = point.solved.at_m - point.surveyed.at_m;
    const Eigen::Matrix3d both = point.solved.covariance_m2 + point.surveyed.covariance_m2;
    const Test test = test_of(delta, both, point.plane, limits);
    const Eigen::Matrix3d inverse = both.inverse();
    if (!std::isfinite(test.chi2) || !inverse.allFinite()) continue;
    out.points.push_back(
        {point.anchor, delta, point.plane, test.chi2, test.limit, test.p_value, test.chi2 <= test.limit});
    information += inverse;
    weighted += inverse * delta;
    mean += both;
    plane = plane || point.plane;
  }
  if (out.points.size() < 2) return out;
  CommonShift shift;
  shift.shift_m = information.inverse() * weighted;
  shift.covariance_m2 = mean / static_cast<double>(out.points.size());
  shift.plane = plane;
  const Test test = test_of(shift.shift_m, shift.covariance_m2, plane, limits);
  shift.chi2 = test.chi2;
  shift.limit = test.limit;
  shift.p_value = test.p_value;
  shift.significant = test.chi2 > test.limit;
  out.shift = shift;
  return out;
}

}  // namespace anchord
