#include "tests/core/localize/cramer_rao.hpp"

#include <Eigen/LU>
#include <array>
#include <cmath>
#include <numbers>
#include <random>

#include "core/localize/flight_solver.hpp"
#include "core/localize/observation.hpp"

namespace anchord::testing {
namespace {

constexpr int k_places = 200;
constexpr double k_blocked_share = 0.2;
const std::array<Eigen::Vector3d, 8> k_anchors{
    {{-14, -9, 3}, {14, -9, 6}, {14, 9, 3}, {-14, 9, 6}, {0, -9, 9}, {0, 9, 1}, {-14, 0, 8}, {14, 0, 2}}};

double los_sigma_m() { return std::sqrt(k_variance_los_m2); }
double nlos_sigma_m() { return std::sqrt(k_variance_nlos_m2); }

/// Three times round the building, 6 m off its walls, up and down between 2 and 18 m.
Eigen::Vector3d place(int i) {
  const double turn = 6.0 * std::numbers::pi * i / k_places;
  return {21 * std::cos(turn), 16 * std::sin(turn), 10 + 8 * std::sin(2.37 * turn)};
}

/// Unlabelled: 0.3 m and up, 0.65 m on average, as the model was told.
RangeErrorModel error_model_of(Ranges ranges, bool blocked) {
  RangeErrorModel error_model;
  error_model.los_sigma_m = los_sigma_m();
  if (ranges == Ranges::labelled) {
    error_model.los_sigma_m = blocked ? nlos_sigma_m() : los_sigma_m();
    return error_model;
  }
  error_model.p_los = 1.0 - k_blocked_share;
  error_model.nlos_bias_m = 0.35;
  error_model.nlos_sigma_m = 0.27;
  error_model.nlos_tail_m = 0.3;
  return error_model;
}

FlightOptions options_of() {
  FlightOptions options;  // nothing but positions is unknown here, and errors are white
  options.fixed_bias_m = 0.0;
  options.delay_prior_m = options.curve_prior_m = options.lag_prior_s = options.lever_prior_m = 1e-5;
  options.correlation_s = options.floor_sigma_m = 0;
  return options;
}

}  // namespace

CramerRao cramer_rao(Ranges ranges, int flights, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> noise(0, 1);
  std::uniform_real_distribution<double> uniform(0, 1);
  double squares_m2 = 0, bound_m2 = 0;
  int inside = 0, n = 0;
  for (int f = 0; f < flights; ++f) {
    FlightData flight;
    flight.mission.frame = TrackFrame::local;
    flight.mission.point = TrackPoint::tag_antenna;
    std::array<Eigen::Matrix3d, 8> information;
    information.fill(Eigen::Matrix3d::Zero());
    for (int i = 0; i < k_places; ++i) {
      const UtcTime time = UtcTime::from_seconds(0.5 * i);  // 4 m/s
      Fix fix;
      fix.time = time;
      fix.frame = TrackFrame::local;
      fix.fix = FixClass::rtk_fixed;
      fix.local_m = place(i) + std::sqrt(k_variance_rtk_m2) *
                                   Eigen::Vector3d(noise(random), noise(random), noise(random));
      fix.covariance_m2 = Eigen::Matrix3d::Identity() * k_variance_rtk_m2;
      flight.fixes.push_back(fix);
      for (std::size_t a = 0; a < k_anchors.size(); ++a) {
        const Eigen::Vector3d way = k_anchors[a] - place(i);
        const bool blocked = uniform(random) < k_blocked_share;
        const double late_m = blocked && ranges != Ranges::labelled ? 0.3 + 0.7 * uniform(random) : 0.0;
        const double sigma_m = blocked ? nlos_sigma_m() : los_sigma_m();
        Range range;
        range.time = time;
        range.tag = NetworkId{0x6e01};
        range.anchor = NetworkId{static_cast<std::uint32_t>(0x6000 + a)};
        range.distance_m = way.norm() + late_m + sigma_m * noise(random);
        flight.ranges.push_back(range);
        if (ranges != Ranges::unmodelled) flight.error_models.emplace_back(error_model_of(ranges, blocked));
        const double spread_m2 = late_m > 0 ? 0.49 / 12.0 : 0.0;
        information[a] +=
            way * way.transpose() / (way.squaredNorm() * (sigma_m * sigma_m + k_variance_rtk_m2 + spread_m2));
      }
    }
    const auto solved = solve_flight(flight, options_of());
    if (!solved) continue;
    for (std::size_t a = 0; a < k_anchors.size(); ++a) {
      const auto& anchor = solved.value().anchors[a];
      if (!anchor.estimate.best) continue;
      const Eigen::Vector3d off = anchor.estimate.best->position.m - k_anchors[a];
      squares_m2 += off.squaredNorm();
      bound_m2 += information[a].inverse().trace();
      inside += off.dot(anchor.estimate.best->covariance_m2.inverse() * off) < 7.815 ? 1 : 0;
      ++n;
    }
  }
  return {std::sqrt(squares_m2 / bound_m2), static_cast<double>(inside) / n, std::sqrt(squares_m2 / n)};
}

}  // namespace anchord::testing
