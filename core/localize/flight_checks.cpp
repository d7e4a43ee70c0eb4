#include "core/localize/flight_checks.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/localize/gates.hpp"
#include "core/localize/kit_prior.hpp"

namespace anchord {
namespace {

constexpr double k_arm_odd_z = 1.5;  // worth another solve
constexpr double k_arm_least_m = 0.1;
constexpr double k_profile_z = 2.5;  // 95 % of the largest of four

template <class... Numbers>
std::string sentence(const char* format, Numbers... numbers) {
  char text[260];
  std::snprintf(text, sizeof text, format, numbers...);
  return text;
}

struct Arm {
  Eigen::Vector2d arm_m{0, 0};
  double z{};

  Arm(const Eigen::Vector2d& m, const Eigen::Matrix2d& covariance_m2)
      : arm_m(m), z(std::sqrt(std::max(m.dot(covariance_m2.inverse() * m), 0.0))) {}
  bool beyond(double limit) const { return z > limit && arm_m.norm() >= k_arm_least_m; }
};

}  // namespace

Result<std::optional<Gate>> check_lever_arm(const FlightRows& rows, const JointFit& fit,
                                            const SharedPrior& prior, const FlightOptions& options) {
  if (options.lever_across_prior_m > 0 || !rows.track.has_attitude()) return std::optional<Gate>{};
  SharedPrior asked = prior;
  asked.information.block<2, 2>(k_shared_forward, k_shared_forward) =
      Eigen::Matrix2d::Identity() / (k_arm_asked_m * k_arm_asked_m);
  const SharedMatrix system = fit.normal.reduced + asked.information;
  const SharedVector step =
      system.ldlt().solve(fit.normal.reduced_gradient + asked.information * (prior.mean - fit.state.shared));
  const SharedMatrix covariance = system.inverse();
  Arm arm(step.segment<2>(k_shared_forward), covariance.block<2, 2>(k_shared_forward, k_shared_forward));
  if (!arm.beyond(k_arm_odd_z)) return std::optional<Gate>{};
  if (!arm.beyond(k_arm_z)) {
    FlightOptions free = options;
    free.lever_across_prior_m = k_arm_asked_m;
    BOOST_OUTCOME_TRY(const auto found, solve_joint(rows, fit.state, asked, free));
    arm = Arm(found.state.shared.segment<2>(k_shared_forward),
              found.shared_covariance.block<2, 2>(k_shared_forward, k_shared_forward));
    if (!arm.beyond(k_arm_z)) return std::optional<Gate>{};
  }
  return std::optional<Gate>{Gate{
      "lever_arm", arm.z, k_arm_z, false,
      sentence(
          "the ranges contradict the declared lever arm: they fit one %+.2f m forward, %+.2f m left of it "
          "(%.1f sigma)",
          arm.arm_m.x(), arm.arm_m.y(), arm.z)}};
}

Gate check_profile(const ProfileFactor& alone, std::span<const ProfileFactor> others,
                   const FlightOptions& options) {
  BiasGate open;  // neither side is told that kits are calibrated
  open.prior_sigma_m = options.bias_prior_m;
  const SharedPrior prior = profile_prior(others, open, options);
  const Eigen::Matrix4d told = prior.information.topLeftCorner<4, 4>().inverse();
  const Eigen::Vector4d mean = prior.mean.head<4>();
  // A weak prior makes the flight's own answer exist where it says nothing of a direction.
  const Eigen::Matrix4d weak = 1e-4 * wide_prior(options).information.topLeftCorner<4, 4>();
  const Eigen::Matrix4d own = (alone.information + weak).inverse();
  const Eigen::Vector4d apart = own * (alone.information_mean + weak * mean) - mean;
  const Eigen::Matrix4d both = told + own;
  const double chi2 = apart.dot(both.ldlt().solve(apart));
  constexpr std::array<const char*, 4> what{"range bias", "range curve", "time lag", "antenna height"};
  int oddest = 0;
  double z = 0;
  for (int i = 0; i < 4; ++i) {
    const double one = std::abs(apart[i]) / std::sqrt(both(i, i));
    if (one > z) {
      z = one;
      oddest = i;
    }
  }
  // Each by itself too: what three of them have in common does not excuse the fourth.
  const double limit = chi2_quantile(GateLimits{}.agreement, 4);
  return {"profile", chi2, limit, chi2 <= limit && z <= k_profile_z,
          sentence("differs from the kit's other flights: chi2 %.1f; most in the %s, by %+.3f (%.1f sigma)",
                   chi2, what[static_cast<std::size_t>(oddest)], apart[oddest], z)};
}

Gate check_steps(double share, const FlightOptions& options) {
  const double limit = options.track.max_step_share;
  return {"track", share, limit, share <= limit,
          sentence("%.1f %% of the positions are shifted together against the others, limit %.1f %%: did the "
                   "base move?",
                   100 * share, 100 * limit)};
}

}  // namespace anchord
