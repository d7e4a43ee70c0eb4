#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/position.hpp"

namespace anchord {

/// What may differ between a local (Pozyx) frame and the site's ENU frame.
enum class FrameModel : std::uint8_t {
  four,   ///< plane similarity: east, north, yaw, scale of the plane; height only shifts (IfcMapConversion)
  seven,  ///< Helmert: three shifts, three rotations, one scale
};

/// A place known in both frames.
struct FramePair {
  std::string name;
  Eigen::Vector3d local_m{0, 0, 0};
  Eigen::Vector3d enu_m{0, 0, 0};
  std::optional<double> sigma_m{};  ///< one sigma per axis of the difference, both sides together
};

/// enu = shift + scale * enu_from_local * local; with FrameModel::four the height keeps its own scale of 1.
struct FrameTransform {
  FrameModel model{FrameModel::seven};
  double scale{1.0};
  Eigen::Matrix3d enu_from_local{Eigen::Matrix3d::Identity()};  ///< rotation, determinant +1
  Eigen::Vector3d shift_m{0, 0, 0};                             ///< local origin, in ENU

  Eigen::Vector3d enu_from(const Eigen::Vector3d& local_m) const;
  Eigen::Vector3d local_from(const Eigen::Vector3d& enu_m) const;
  double yaw_deg() const;   ///< from east to the local x axis, counter-clockwise, (-180, 180]
  double tilt_deg() const;  ///< between up and the local z axis, [0, 180]
};

struct FramePairResidual {
  Eigen::Vector3d residual_m{0, 0, 0};  ///< given minus fitted, ENU
  /// Given minus predicted by the other pairs alone: what shows a wrong pair, which a fit of few pairs hides
  /// in small residuals. Absent when the others do not determine a fit.
  std::optional<Eigen::Vector3d> left_out_m{};
};

/// Order of the parameters of FrameFit::covariance: shift at the centroid e, n, u (m), rotation about e, n, u
/// (rad), relative scale. With FrameModel::four the rotations about e and n are fixed, their rows zero.
using FrameCovariance = Eigen::Matrix<double, 7, 7>;

struct FrameFit {
  FrameTransform transform;
  Eigen::Vector3d centroid_local_m{0, 0, 0};  ///< of the pairs, weighted; where the shift is uncorrelated
  std::vector<FramePairResidual> residuals;   ///< in the order of the pairs
  double rms_m{};                             ///< of the residuals, per pair, all three axes
  int dof{};
  /// Absent when nothing tells it: no redundant pair and no sigma given.
  std::optional<FrameCovariance> covariance{};
  std::vector<std::string> notes;  ///< for people: mirrored axes, suspicious pairs, no redundancy

  /// Covariance (m^2, ENU) that the transform adds to a point of the local frame; zero matrix without one.
  Eigen::Matrix3d covariance_at(const Eigen::Vector3d& local_m) const;
  /// Covariance (m^2, ENU) of a place known in the local frame with `local_covariance_m2` (m^2, local axes)
  /// once it is told on the globe: turned and scaled into ENU, plus what the fit adds. Errors of the place
  /// and of the fit are taken as independent. Nothing where the fit tells no covariance.
  std::optional<Eigen::Matrix3d> enu_covariance(const Eigen::Vector3d& local_m,
                                                const Eigen::Matrix3d& local_covariance_m2) const;
};

struct FrameFitOptions {
  FrameModel model{FrameModel::seven};
  bool fit_scale{true};         ///< false: metres are metres; for frames measured with a tape or laser
  double min_spread_m{0.10};    ///< closer pairs tell no direction
  double min_line_ratio{0.02};  ///< second over first spread below this: the pairs lie on a line (seven)
};

/// Weighted least-squares transform from local to ENU, in closed form: complex ratio in the plane for `four`,
/// Umeyama's SVD for `seven` (Horn 1987; Umeyama, IEEE TPAMI 13, 1991, eq 40-43). Weights 1/sigma^2, all
/// equal where no pair has a sigma. The covariance is scaled by what the residuals say: by chi^2/dof without
/// sigmas, by max(1, chi^2/dof) with them.
///
/// errors   too_few_observations (four: 2 pairs, seven: 3), weak_geometry (one place, or one line),
///          invalid_argument (not finite, sigma not above 0, sigma on some pairs only)
/// accuracy exact pairs come back within 1e-9 of their extent (frame_fit_test.cpp)
/// threads  pure
Result<FrameFit> fit_frame(std::span<const FramePair> pairs, const FrameFitOptions& options = {});

}  // namespace anchord
