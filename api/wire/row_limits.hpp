#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>

#include "api/kit/value_bounds.hpp"

/// What a field of a range or a fix may be: the same for every reader of rows.
namespace anchord::api::row_limits {

inline constexpr WholeBounds k_t_us{0, 4'102'444'800'000'000};  // up to the year 2100
inline constexpr WholeBounds k_seq{0, INT64_MAX};
inline constexpr WholeBounds k_antenna{0, 255}, k_satellites{0, 255};
inline constexpr std::size_t k_network_id_bytes = 20, k_campaign_bytes = 200, k_uuid_bytes = 36;

inline constexpr Bounds k_distance_m{0.05, 150};  // reliability of DW1000 radios; 0 is their failure value
inline constexpr Bounds k_dbm{-200, 50};          // -999 and its like say that there is no level
inline constexpr Bounds k_register{0, 1e9};       // of a campaign's samples
inline constexpr Bounds k_campaign_range_m{0.05, 10'000}, k_campaign_truth_m{1e-3, 10'000};
inline constexpr Bounds k_std_noise{0, 65535};
inline constexpr Bounds k_heading_deg{-360, 360};
inline constexpr Bounds k_truth_distance_m{0, 1000};

inline constexpr WholeBounds k_cir_taps{1, 4096};
inline constexpr Bounds k_cir_dt_ps{1, 1e6};
inline constexpr Bounds k_cir_first_path{0, 4096};
inline constexpr Bounds k_cir_preamble{0, 1e6};
inline constexpr std::size_t k_cir_base64_bytes = 32768;

inline constexpr Bounds k_lon_deg{-180, 180}, k_lat_deg{-90, 90}, k_height_m{-500, 9000};
inline constexpr Bounds k_local_m{-1e5, 1e5};
inline constexpr Bounds k_sigma_m{1e-5, 1000}, k_covariance_m2{-1e6, 1e6};
inline constexpr Bounds k_quaternion{-1.01, 1.01};
inline constexpr Bounds k_correction_age_s{0, 1e6};

/// What a receiver without a fix sends.
inline bool null_island(double lon_deg, double lat_deg) { return lon_deg == 0 && lat_deg == 0; }

/// Of [ee, en, eu, nn, nu, uu]; nothing where it is not positive definite (Sylvester: all leading minors
/// positive).
inline std::optional<Eigen::Matrix3d> covariance_of(const std::array<double, 6>& v) {
  Eigen::Matrix3d c;
  c << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
  if (!(c(0, 0) > 0 && c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1) > 0 && c.determinant() > 0)) return std::nullopt;
  return c;
}
inline Eigen::Matrix3d covariance_of_sigmas(const std::array<double, 3>& sigma_m) {
  return Eigen::Vector3d(sigma_m[0] * sigma_m[0], sigma_m[1] * sigma_m[1], sigma_m[2] * sigma_m[2])
      .asDiagonal();
}

/// Of [qx, qy, qz, qw]; nothing where its norm is off by more than a hundredth.
inline std::optional<Eigen::Quaterniond> rotation_of(const std::array<double, 4>& q) {
  const Eigen::Quaterniond rotation(q[3], q[0], q[1], q[2]);
  if (std::abs(rotation.norm() - 1) > 0.01) return std::nullopt;
  return rotation.normalized();
}
/// Headings count clockwise from north; the body's x axis points forward, ENU angles count counter-clockwise
/// from east.
inline Eigen::Quaterniond rotation_of_heading(double heading_deg) {
  const double yaw_rad = (90.0 - heading_deg) * std::numbers::pi / 180.0;
  return Eigen::Quaterniond(Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()));
}

}  // namespace anchord::api::row_limits
