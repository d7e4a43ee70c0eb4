#include "core/geo/frame_fit.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>

namespace anchord {
namespace {

constexpr double k_deg = 180.0 / std::numbers::pi;

/// Pairs reduced to their weighted centroids.
struct Centred {
  std::vector<double> weights;
  Eigen::Vector3d local_centroid_m{0, 0, 0}, enu_centroid_m{0, 0, 0};
  Eigen::Matrix3Xd local_m, enu_m;
  double weight_sum{};
};

std::string text(const char* format, double a, double b = 0) {
  char buffer[200];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

Centred centre(std::span<const FramePair> pairs) {
  Centred c;
  const auto n = static_cast<Eigen::Index>(pairs.size());
  c.local_m.resize(3, n);
  c.enu_m.resize(3, n);
  for (const auto& pair : pairs) {
    const double weight = pair.sigma_m ? 1.0 / (*pair.sigma_m * *pair.sigma_m) : 1.0;
    c.weights.push_back(weight);
    c.weight_sum += weight;
    c.local_centroid_m += weight * pair.local_m;
    c.enu_centroid_m += weight * pair.enu_m;
  }
  c.local_centroid_m /= c.weight_sum;
  c.enu_centroid_m /= c.weight_sum;
  for (Eigen::Index i = 0; i < n; ++i) {
    c.local_m.col(i) = pairs[static_cast<std::size_t>(i)].local_m - c.local_centroid_m;
    c.enu_m.col(i) = pairs[static_cast<std::size_t>(i)].enu_m - c.enu_centroid_m;
  }
  return c;
}

/// Standard deviations along the principal axes, descending; the first two rows only in the plane.
Eigen::Vector3d spread(const Eigen::Matrix3Xd& centred_m, FrameModel model) {
  Eigen::Matrix3Xd points = centred_m;
  if (model == FrameModel::four) points.row(2).setZero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (Eigen::Index i = 0; i < points.cols(); ++i) scatter += points.col(i) * points.col(i).transpose();
  scatter /= static_cast<double>(points.cols());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(scatter, Eigen::EigenvaluesOnly);
  return eigen.eigenvalues().reverse().cwiseMax(0).cwiseSqrt();
}

Result<void> check(std::span<const FramePair> pairs, const FrameFitOptions& options) {
  const std::size_t need = options.model == FrameModel::four ? 2 : 3;
  if (pairs.size() < need)
    return make_error(Errc::too_few_observations, std::to_string(pairs.size()) + " pairs, a " +
                                                      (need == 2 ? "4" : "7") + "-parameter fit needs " +
                                                      std::to_string(need));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto& pair = pairs[i];
    const std::string who =
        "pair " + std::to_string(i + 1) + (pair.name.empty() ? "" : " (" + pair.name + ")");
    if (!pair.local_m.allFinite() || !pair.enu_m.allFinite())
      return make_error(Errc::invalid_argument, who + " is not finite");
    if (pair.sigma_m.has_value() != pairs.front().sigma_m.has_value())
      return make_error(Errc::invalid_argument, who + ": give a sigma for all pairs or for none");
    if (pair.sigma_m && !(*pair.sigma_m > 0 && std::isfinite(*pair.sigma_m)))
      return make_error(Errc::invalid_argument, who + ": sigma must be above 0");
  }
  return boost::outcome_v2::success();
}

Result<void> check_geometry(const Centred& c, const FrameFitOptions& options) {
  for (const auto* points : {&c.local_m, &c.enu_m}) {
    const char* frame = points == &c.local_m ? "local" : "global";
    const Eigen::Vector3d sd = spread(*points, options.model);
    if (sd[0] < options.min_spread_m)
      return make_error(Errc::weak_geometry,
                        std::string("the pairs are too close together in the ") + frame +
                            text(" frame: spread %.3f m, need %.2f m", sd[0], options.min_spread_m));
    if (options.model == FrameModel::seven && sd[1] < options.min_line_ratio * sd[0])
      return make_error(
          Errc::weak_geometry,
          std::string("the pairs lie on one line in the ") + frame +
              text(" frame (%.3f m across, %.2f m along): the rotation about it is not determined", sd[1],
                   sd[0]));
  }
  return boost::outcome_v2::success();
}

/// Rotation and scale of centred pairs. `mirrored`: as if the local y axis pointed the other way.
FrameTransform plane(const Centred& c, bool fit_scale, bool mirrored) {
  std::complex<double> cross = 0;
  double square = 0;
  for (Eigen::Index i = 0; i < c.local_m.cols(); ++i) {
    const double w = c.weights[static_cast<std::size_t>(i)];
    const std::complex<double> local(c.local_m(0, i), mirrored ? -c.local_m(1, i) : c.local_m(1, i));
    cross += w * std::conj(local) * std::complex<double>(c.enu_m(0, i), c.enu_m(1, i));
    square += w * std::norm(local);
  }
  FrameTransform t;
  t.model = FrameModel::four;
  t.scale = fit_scale ? std::abs(cross) / square : 1.0;
  t.enu_from_local = Eigen::AngleAxisd(std::arg(cross), Eigen::Vector3d::UnitZ()).toRotationMatrix();
  return t;
}

FrameTransform space(const Centred& c, bool fit_scale) {
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  double square = 0;
  for (Eigen::Index i = 0; i < c.local_m.cols(); ++i) {
    const double w = c.weights[static_cast<std::size_t>(i)];
    cross += w * c.enu_m.col(i) * c.local_m.col(i).transpose();
    square += w * c.local_m.col(i).squaredNorm();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(cross, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Vector3d sign(1, 1, 1);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0) sign[2] = -1;
  FrameTransform t;
  t.enu_from_local = svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
  t.scale = fit_scale ? svd.singularValues().dot(sign) / square : 1.0;
  return t;
}

/// d(enu) / d(parameters) at a point given from the centroid, in local axes.
Eigen::Matrix<double, 3, 7> jacobian(const FrameTransform& t, const Eigen::Vector3d& centred_local_m) {
  const bool four = t.model == FrameModel::four;
  Eigen::Vector3d turned = t.scale * (t.enu_from_local * centred_local_m);
  if (four) turned.z() = 0;
  Eigen::Matrix<double, 3, 7> j = Eigen::Matrix<double, 3, 7>::Zero();
  j.leftCols<3>().setIdentity();
  for (int axis = four ? 2 : 0; axis < 3; ++axis) j.col(3 + axis) = Eigen::Vector3d::Unit(axis).cross(turned);
  j.col(6) = turned;
  return j;
}

void fill_covariance(std::span<const FramePair> pairs, const Centred& c, const FrameFitOptions& options,
                     FrameFit& fit) {
  std::vector<Eigen::Index> active{0, 1, 2};
  if (options.model == FrameModel::seven) active.insert(active.end(), {3, 4});
  active.push_back(5);
  if (options.fit_scale) active.push_back(6);
  const auto n = static_cast<Eigen::Index>(active.size());
  FrameCovariance information = FrameCovariance::Zero();
  double chi2 = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const auto j = jacobian(fit.transform, c.local_m.col(static_cast<Eigen::Index>(i)));
    information += c.weights[i] * j.transpose() * j;
    chi2 += c.weights[i] * fit.residuals[i].residual_m.squaredNorm();
  }
  fit.dof = static_cast<int>(3 * pairs.size()) - static_cast<int>(n);
  const bool known = pairs.front().sigma_m.has_value();
  if (fit.dof <= 0 && !known) {
    fit.notes.emplace_back("no redundant pair: the residuals are zero by construction and prove nothing");
    return;
  }
  const double factor = fit.dof > 0 ? chi2 / fit.dof : 1.0;
  // A parameter that is not fitted stands alone with 1 while the rest is inverted.
  const auto fitted = [&](Eigen::Index k) {
    return std::find(active.begin(), active.end(), k) != active.end();
  };
  for (Eigen::Index k = 0; k < information.rows(); ++k) {
    if (fitted(k)) continue;
    information.row(k).setZero();
    information.col(k).setZero();
    information(k, k) = 1;
  }
  FrameCovariance covariance = information.inverse() * (known ? std::max(1.0, factor) : factor);
  for (Eigen::Index k = 0; k < information.rows(); ++k)
    if (!fitted(k)) covariance(k, k) = 0;
  fit.covariance = covariance;
}

/// Root mean square of the pairs in the plane after a plane fit.
double plane_rms(const Centred& c, bool fit_scale, bool mirrored) {
  const FrameTransform t = plane(c, fit_scale, mirrored);
  double sum = 0;
  for (Eigen::Index i = 0; i < c.local_m.cols(); ++i) {
    Eigen::Vector3d local = c.local_m.col(i);
    if (mirrored) local.y() = -local.y();
    const Eigen::Vector3d off = c.enu_m.col(i) - t.scale * (t.enu_from_local * local);
    sum += off.head<2>().squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(c.local_m.cols()));
}

void add_notes(std::span<const FramePair> pairs, const Centred& c, const FrameFitOptions& options,
               FrameFit& fit) {
  if (options.model == FrameModel::four && pairs.size() > 2) {
    const double straight = plane_rms(c, options.fit_scale, false),
                 mirrored = plane_rms(c, options.fit_scale, true);
    if (mirrored < 0.2 * straight && straight > 0.05)
      fit.notes.push_back(
          text("with one local axis reversed the pairs fit within %.3f m instead of %.3f m: "
               "is the local frame left-handed, or are two columns swapped?",
               mirrored, straight));
  }
  if (fit.transform.tilt_deg() > 90)
    fit.notes.push_back(
        text("the local z axis points %.0f degrees away from up: is the local frame left-handed?",
             fit.transform.tilt_deg()));
  if (options.fit_scale && std::abs(fit.transform.scale - 1) > 0.02)
    fit.notes.push_back(text(
        "scale %.4f: one unit of the local frame is not one metre; check its unit and its range calibration",
        fit.transform.scale));
  std::size_t worst = 0;
  double worst_m = 0, rest = 0;
  for (std::size_t i = 0; i < fit.residuals.size(); ++i) {
    if (!fit.residuals[i].left_out_m) return;
    const double m = fit.residuals[i].left_out_m->norm();
    rest += m;
    if (m > worst_m) {
      worst_m = m;
      worst = i;
    }
  }
  rest = (rest - worst_m) / static_cast<double>(std::max<std::size_t>(1, fit.residuals.size() - 1));
  if (worst_m > 3 * rest && worst_m > 0.05 && pairs.size() > 4)
    fit.notes.push_back(
        "pair " + (pairs[worst].name.empty() ? std::to_string(worst + 1) : pairs[worst].name) +
        text(" lies %.3f m from where the others put it (the others: %.3f m)", worst_m, rest));
}

Result<FrameFit> fit_once(std::span<const FramePair> pairs, const FrameFitOptions& options,
                          const Centred& c) {
  FrameFit fit;
  fit.transform =
      options.model == FrameModel::four ? plane(c, options.fit_scale, false) : space(c, options.fit_scale);
  if (!(fit.transform.scale > 0) || !fit.transform.enu_from_local.allFinite())
    return make_error(Errc::weak_geometry, "the pairs give no scale: the two frames do not correspond");
  fit.centroid_local_m = c.local_centroid_m;
  fit.transform.shift_m.setZero();
  fit.transform.shift_m = c.enu_centroid_m - fit.transform.enu_from(c.local_centroid_m);
  double square = 0;
  for (const auto& pair : pairs) {
    fit.residuals.push_back({pair.enu_m - fit.transform.enu_from(pair.local_m), std::nullopt});
    square += fit.residuals.back().residual_m.squaredNorm();
  }
  fit.rms_m = std::sqrt(square / static_cast<double>(pairs.size()));
  return fit;
}

}  // namespace

Eigen::Vector3d FrameTransform::enu_from(const Eigen::Vector3d& local_m) const {
  Eigen::Vector3d enu = scale * (enu_from_local * local_m);
  if (model == FrameModel::four) enu.z() = local_m.z();
  return enu + shift_m;
}

Eigen::Vector3d FrameTransform::local_from(const Eigen::Vector3d& enu_m) const {
  const Eigen::Vector3d off = enu_m - shift_m;
  Eigen::Vector3d local = enu_from_local.transpose() * off / scale;
  if (model == FrameModel::four) local.z() = off.z();
  return local;
}

double FrameTransform::yaw_deg() const {
  return std::atan2(enu_from_local(1, 0), enu_from_local(0, 0)) * k_deg;
}

double FrameTransform::tilt_deg() const {
  return std::acos(std::clamp(enu_from_local(2, 2), -1.0, 1.0)) * k_deg;
}

Eigen::Matrix3d FrameFit::covariance_at(const Eigen::Vector3d& local_m) const {
  if (!covariance) return Eigen::Matrix3d::Zero();
  const auto j = jacobian(transform, local_m - centroid_local_m);
  return j * *covariance * j.transpose();
}

std::optional<Eigen::Matrix3d> FrameFit::enu_covariance(const Eigen::Vector3d& local_m,
                                                        const Eigen::Matrix3d& local_covariance_m2) const {
  if (!covariance) return std::nullopt;
  const double up_scale = transform.model == FrameModel::four ? 1.0 : transform.scale;
  const Eigen::Vector3d scales(transform.scale, transform.scale, up_scale);
  const Eigen::Matrix3d enu_by_local = transform.enu_from_local * scales.asDiagonal();
  return enu_by_local * local_covariance_m2 * enu_by_local.transpose() + covariance_at(local_m);
}

Result<FrameFit> fit_frame(std::span<const FramePair> pairs, const FrameFitOptions& options) {
  BOOST_OUTCOME_TRYV(check(pairs, options));
  const Centred c = centre(pairs);
  BOOST_OUTCOME_TRYV(check_geometry(c, options));
  BOOST_OUTCOME_TRY(auto fit, fit_once(pairs, options, c));
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    std::vector<FramePair> others(pairs.begin(), pairs.end());
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(i));
    if (!check(others, options)) break;
    const Centred rest = centre(others);
    if (!check_geometry(rest, options)) continue;
    const auto without = fit_once(others, options, rest);
    if (without)
      fit.residuals[i].left_out_m = pairs[i].enu_m - without.value().transform.enu_from(pairs[i].local_m);
  }
  fill_covariance(pairs, c, options, fit);
  add_notes(pairs, c, options, fit);
  return fit;
}

}  // namespace anchord
