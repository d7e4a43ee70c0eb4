#include "core/localize/flight_solver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "core/localize/flight_checks.hpp"
#include "core/localize/flight_verdict.hpp"
#include "core/localize/joint_model.hpp"
#include "core/localize/kit_prior.hpp"

namespace anchord {
namespace {

/// One flight under way through the passes.
struct Work {
  FlightRows rows;
  JointFit fit;
  SharedPrior prior;
  ProfileFactor factor;
  ProfileFactor alone;  ///< what the flight said before it was told anything
  std::string kit, name;
  double wide_bias_sigma_m{};  ///< of the flight alone
  BiasGate gate;
  std::vector<Gate> checks;  ///< of the whole flight: every anchor must pass them
};

Result<void> solve_with(Work& work, const SharedPrior& prior, const FlightOptions& options) {
  work.prior = prior;
  BOOST_OUTCOME_TRY(work.fit, solve_joint(work.rows, joint_start(work.rows, prior, options), prior, options));
  work.factor = profile_factor(work.fit, prior, work.name);
  return boost::outcome_v2::success();
}

bool same_kit(const Work& a, const Work& b) { return !a.kit.empty() && a.kit == b.kit; }

/// Factors of the other flights of the kit: those solved now, and the stored profile's except this very
/// flight's.
std::vector<ProfileFactor> others_of(const std::vector<Work>& all, std::size_t index,
                                     const FlightOptions& options) {
  std::vector<ProfileFactor> factors;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i != index && same_kit(all[i], all[index])) factors.push_back(all[i].factor);
  }
  if (options.profile && (options.profile->kit.empty() || options.profile->kit == all[index].kit)) {
    for (const auto& factor : options.profile->factors) {
      const bool solved_now = std::ranges::any_of(
          all, [&](const Work& w) { return same_kit(w, all[index]) && w.name == factor.flight; });
      if (!solved_now && factor.flight != all[index].name) factors.push_back(factor);
    }
  }
  return factors;
}

std::string sentence(const char* format, double a, double b, double c) {
  char text[260];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

std::size_t n_believed(const FlightRows& flight) {
  std::size_t n = 0;
  for (const AnchorRows& anchor : flight.anchors) {
    n += static_cast<std::size_t>(
        std::ranges::count_if(anchor.rows, [](const JointRow& row) { return row.belief.has_value(); }));
  }
  return n;
}

FlightSolution describe(const Work& work, const FlightData& flight, const FlightOptions& options) {
  FlightSolution solution;
  solution.mission = flight.mission.id;
  solution.name = flight.mission.name;
  if (work.rows.frame) solution.origin = work.rows.frame->origin();
  solution.notes = flight.notes;
  solution.notes.insert(solution.notes.end(), work.rows.notes.begin(), work.rows.notes.end());
  const auto valued = [&](int i) {
    return Valued{work.fit.state.shared[i], std::sqrt(std::max(work.fit.shared_covariance(i, i), 0.0))};
  };
  solution.shared.bias_m = valued(k_shared_bias);
  solution.shared.curve_m = valued(k_shared_curve);
  solution.shared.lag_s = valued(k_shared_lag);
  solution.shared.lever_up_m = valued(k_shared_lever);
  if (options.lever_across_prior_m > 0) {
    solution.shared.lever_forward_m = valued(k_shared_forward);
    solution.shared.lever_left_m = valued(k_shared_left);
  }
  if (!work.rows.pairs.empty()) {
    solution.notes.push_back(std::to_string(work.rows.pairs.size()) +
                             " distances between anchors took part in the solve");
  }
  if (const std::size_t n = n_believed(work.rows); n > 0) {
    solution.notes.push_back(std::to_string(n) +
                             " ranges were weighed by the likelihood of a model, not by the loss");
  }
  solution.shared.bias_z = work.gate.z;
  solution.shared.bias_determined = options.fixed_bias_m || work.gate.known;
  if (!solution.shared.bias_determined) {
    solution.notes.push_back(
        sentence("bias not determined by this flight, profile missing: %.3f m with sigma %.3f m (z %.1f)",
                 work.gate.bias_m, work.gate.sigma_m, work.gate.z));
  }
  for (const Gate& check : work.checks) {
    if (!check.passed) solution.notes.push_back(check.why);
  }
  if (!work.fit.converged) {
    solution.notes.push_back("the joint solve did not settle within " + std::to_string(work.fit.rounds) +
                             " rounds");
  }
  for (std::size_t i = 0; i < work.rows.anchors.size(); ++i) {
    AnchorSolution anchor = judge_anchor(work.rows, work.fit, i, options);
    if (anchor.estimate.best) {
      auto& gates = anchor.estimate.gates;
      gates.insert(gates.end(), work.checks.begin(), work.checks.end());
    }
    anchor.estimate.bias_m = solution.shared.bias_m.value + anchor.delay_m.value_or(0.0);
    anchor.estimate.bias_sigma_m =
        std::hypot(solution.shared.bias_m.sigma, anchor.delay_sigma_m.value_or(options.delay_prior_m));
    anchor.estimate.lag_s = solution.shared.lag_s.value;
    anchor.estimate.lag_sigma_s = solution.shared.lag_s.sigma;
    for (const auto& [why, count] : anchor.estimate.refused) solution.refused[why] += count;
    solution.n_used += anchor.estimate.n_used;
    solution.anchors.push_back(std::move(anchor));
  }
  solution.fixes_refused = work.rows.fixes_refused;
  solution.n_ranges = flight.ranges.size();
  solution.n_fixes = flight.fixes.size();
  return solution;
}

}  // namespace

Result<void> FlightOptions::check() const {
  const auto positive = [](double v) { return std::isfinite(v) && v > 0; };
  const bool good = positive(bias_prior_m) && positive(calibrated_bias_prior_m) && positive(delay_prior_m) &&
                    positive(curve_prior_m) && positive(lag_prior_s) && positive(lever_prior_m) &&
                    positive(mad_factor) && positive(min_scale_m) && correlation_s >= 0 &&
                    floor_sigma_m >= 0 && min_range_m >= 0 && max_range_m > min_range_m &&
                    (!max_gap_s || positive(*max_gap_s)) && positive(track.max_speed_mps) &&
                    positive(track.max_acceleration_mps2) && positive(track.max_correction_age_s) &&
                    (!anchor_height_m || std::isfinite(*anchor_height_m)) &&
                    (!fixed_bias_m || std::isfinite(*fixed_bias_m));
  if (good) return boost::outcome_v2::success();
  return make_error(Errc::invalid_argument,
                    "flight options: sigmas, limits and factors must be positive and finite");
}

Result<FlightSolution> solve_flight(const FlightData& flight, const FlightOptions& options) {
  const FlightData* one[] = {&flight};
  BOOST_OUTCOME_TRY(auto solutions, solve_flights(one, options));
  return std::move(solutions.front());
}

Result<std::vector<FlightSolution>> solve_flights(std::span<const FlightData* const> flights,
                                                  const FlightOptions& options, KitProfile* profile) {
  BOOST_OUTCOME_TRY(options.check());
  std::vector<Work> all;
  for (const FlightData* flight : flights) {
    auto rows = flight_rows(*flight, options);
    if (!rows) return make_error(rows.error().code, flight->mission.name + ": " + rows.error().message);
    all.push_back(
        {std::move(rows.value()), {}, {}, {}, {}, flight->mission.kit, flight->mission.name, 0, {}, {}});
  }
  for (Work& work : all) {
    BOOST_OUTCOME_TRY(solve_with(work, wide_prior(options), options));
    work.alone = work.factor;
  }
  // Two passes: what a flight says about the kit depends a little on what it was told.
  for (int pass = 0; pass < 2; ++pass) {
    std::vector<SharedPrior> priors;
    for (std::size_t i = 0; i < all.size(); ++i) {
      auto factors = others_of(all, i, options);
      auto with_own = factors;
      with_own.push_back(all[i].factor);
      all[i].gate = bias_gate(with_own, options);
      priors.push_back(profile_prior(factors, all[i].gate, options));
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
      // A flight alone whose gate changed nothing is solved already.
      const bool same =
          priors[i].mean == all[i].prior.mean && priors[i].information == all[i].prior.information;
      if (same) continue;
      BOOST_OUTCOME_TRY(solve_with(all[i], priors[i], options));
    }
  }
  if (!options.fixed_bias_m) {
    for (Work& work : all) add_doubt(work.fit, work.prior, work.gate);
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    Work& work = all[i];
    BOOST_OUTCOME_TRY(const auto arm, check_lever_arm(work.rows, work.fit, work.prior, options));
    if (arm) work.checks.push_back(*arm);
    if (work.rows.step_share > 0) work.checks.push_back(check_steps(work.rows.step_share, options));
    const auto others = others_of(all, i, options);
    if (!others.empty() && !options.fixed_bias_m)
      work.checks.push_back(check_profile(work.alone, others, options));
  }
  if (profile) {
    profile->kit = all.empty() ? "" : all.front().kit;
    profile->factors = all.empty() ? std::vector<ProfileFactor>{} : others_of(all, 0, options);
    if (!all.empty()) profile->factors.push_back(all.front().factor);
  }
  std::vector<FlightSolution> solutions;
  for (std::size_t i = 0; i < all.size(); ++i) solutions.push_back(describe(all[i], *flights[i], options));
  return solutions;
}

}  // namespace anchord
