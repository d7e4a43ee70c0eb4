#include "core/procedure/height_search.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <string>

namespace anchord::procedure {
namespace {

// Level over elevation, dB per square radian: two half-wave dipoles and the way's length make 17, two patch
// antennas of 50 degrees between their half-power points 36.
constexpr double k_sharpest_db = 60;
constexpr double k_sharper_sigmas = 2;

}  // namespace

Result<HeightGuess> height_from_search(std::span<const HeightSample> samples,
                                       std::optional<double> distance_m) {
  constexpr double k_best_sigma_m = 0.2;  // Fig 8.5b
  if (samples.size() < 5) {
    return make_error(Errc::too_few_observations,
                      std::to_string(samples.size()) + " samples of a height search, need 5");
  }
  double low = samples[0].height_m, high = low;
  for (const auto& s : samples) {
    if (!std::isfinite(s.height_m) || !std::isfinite(s.rss_dbm)) {
      return make_error(Errc::invalid_argument, "a sample of the height search is not finite");
    }
    low = std::min(low, s.height_m);
    high = std::max(high, s.height_m);
  }
  if (high - low < 0.5) return make_error(Errc::weak_geometry, "the search covers less than 0.5 m of height");

  const double middle = (low + high) / 2, half = (high - low) / 2;
  Eigen::MatrixXd m(static_cast<Eigen::Index>(samples.size()), 3);
  Eigen::VectorXd y(m.rows());
  for (Eigen::Index i = 0; i < m.rows(); ++i) {
    const auto& s = samples[static_cast<std::size_t>(i)];
    const double x = (s.height_m - middle) / half;
    m.row(i) << 1, x, x * x;
    y[i] = s.rss_dbm;
  }
  const Eigen::Vector3d c = m.colPivHouseholderQr().solve(y);
  const double peak = c[2] < 0 ? -c[1] / (2 * c[2]) : 2;
  if (std::abs(peak) <= 1) {
    // First-order error of the peak: residual over the curvature.
    const double dof = static_cast<double>(samples.size()) - 3;
    const double rms = std::sqrt((y - m * c).squaredNorm() / dof);
    const Eigen::Matrix3d cov = (m.transpose() * m).inverse() * rms * rms;
    const Eigen::Vector3d slope{0, -1 / (2 * c[2]), c[1] / (2 * c[2] * c[2])};
    const double sigma = half * std::sqrt(std::max(0.0, slope.dot(cov * slope)));
    const double curvature_sigma = std::sqrt(std::max(cov(2, 2), 1e-12));
    const double least_db_per_m2 = (-c[2] - k_sharper_sigmas * curvature_sigma) / (half * half);
    const bool too_narrow = distance_m && least_db_per_m2 * *distance_m * *distance_m > k_sharpest_db;
    return HeightGuess{middle + half * peak,
                       std::clamp(sigma, k_best_sigma_m, std::max(half, k_best_sigma_m)),
                       -c[2] / curvature_sigma, false, too_narrow};
  }
  const auto best = std::max_element(samples.begin(), samples.end(),
                                     [](const auto& a, const auto& b) { return a.rss_dbm < b.rss_dbm; });
  return HeightGuess{best->height_m, std::max(half, k_best_sigma_m), 0, true};
}

}  // namespace anchord::procedure
