#include "core/localize/flight_solver.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <set>

#include "core/localize/clock_offset.hpp"
#include "core/localize/direction_doubt.hpp"
#include "core/localize/flight_checks.hpp"
#include "core/localize/flight_copies.hpp"
#include "core/localize/flight_digest.hpp"
#include "core/localize/flight_verdict.hpp"
#include "core/localize/joint_rounds.hpp"
#include "core/localize/kit_prior.hpp"
#include "core/localize/own_delay.hpp"
#include "core/localize/region_reason.hpp"
#include "core/localize/scatter_doubt.hpp"
#include "core/localize/sector_doubt.hpp"
#include "core/localize/systematic_error.hpp"
#include "core/localize/track_shift.hpp"
#include "core/localize/unplaced.hpp"
#include "core/localize/unseen_arm.hpp"

namespace anchord {
namespace {

constexpr double k_most_bias_m = 200;  // a DW1000 whose antenna delay was never set: 154 m

/// One flight under way through the passes.
struct Work {
  FlightRows rows;
  FlightOptions options{};  ///< in the frame of the rows
  JointFit fit{};
  JointStart start{};  ///< by `prior`, of which it asks the mean alone
  JointNormal at_start{};
  SharedPrior prior{};
  ProfileFactor factor{};
  ProfileFactor alone{};  ///< what the flight said before it was told anything
  std::string kit{}, name{}, digest{}, dated_digest{};
  std::optional<std::size_t> copy_of{};  ///< which of the flights has its ranges already
  BiasGate gate{};
  std::vector<Gate> checks{};                ///< of the whole flight: every anchor must pass them
  std::vector<Gate> unseen_arm{};            ///< one for each anchor, where it is asked
  std::optional<SystematicErrors> errors{};  ///< of the ranges
  std::vector<Eigen::Matrix3d> shift_m2{};   ///< of each region, by shifts of the track that may be
  bool antennas_apart{true};                 ///< their vertical arms differ by what this flight can show

  Eigen::Index antennas() const {
    return static_cast<Eigen::Index>(std::min<std::size_t>(rows.antennas.size(), k_most_antennas));
  }
};

/// The options in the flight's own frame: heights above its origin, the height prior with every anchor that
/// has no height of its own.
FlightOptions in_frame_of(const FlightRows& rows, FlightOptions options) {
  const double origin_m = rows.frame ? rows.frame->origin().height_m : 0.0;
  if (options.anchor_height_m) *options.anchor_height_m -= origin_m;
  if (!options.height_prior) return options;
  for (const AnchorRows& anchor : rows.anchors) {
    auto& height = options.priors[anchor.id].height;
    if (!height) height = {options.height_prior->height_m - origin_m, options.height_prior->sigma_m};
  }
  return options;
}

/// What the antennas of a flight have in common is l_z, which the kit's profile may know; each by itself has
/// only what it differs from that, so that the differences sum to nothing, and are nothing where the flight
/// does not show them.
SharedPrior for_antennas(SharedPrior prior, const Work& work) {
  constexpr double k_tight = 1.0 / (1e-3 * 1e-3);
  const auto n = work.antennas();
  if (n < 2) return prior;
  auto arms = prior.information.block(k_shared_antennas, k_shared_antennas, n, n);
  arms.array() += k_tight;
  if (!work.antennas_apart) arms.diagonal().array() += k_tight;
  return prior;
}

/// An unknown that a flight hardly sees costs its anchors accuracy: one antenna must differ beyond doubt.
bool shows_antennas_apart(const Work& work) {
  constexpr double k_beyond_doubt = 4;
  for (Eigen::Index k = k_shared_antennas; k < k_shared_antennas + work.antennas(); ++k) {
    const double sigma_m = std::sqrt(std::max(work.fit.shared_covariance(k, k), 0.0));
    if (std::abs(work.fit.state.shared[k]) > k_beyond_doubt * sigma_m) return true;
  }
  return false;
}

Result<void> solve_with(Work& work, const SharedPrior& prior) {
  const FlightOptions& options = work.options;
  if (work.start.searches.empty() || work.prior.mean != prior.mean) {
    work.start = joint_start(work.rows, prior, options);
    work.at_start = normal_at_start(work.rows, work.start.state, options);
  }
  work.prior = prior;
  BOOST_OUTCOME_TRY(work.fit, solve_joint_from(work.rows, work.start.state, work.at_start, prior, options));
  work.factor = profile_factor(work.fit, prior, work.name);
  work.factor.digest = work.digest;
  return boost::outcome_v2::success();
}

/// Sigmas within a fortieth: the answer moves by less than that.
bool about_same(const SharedPrior& a, const SharedPrior& b) {
  const SharedMatrix apart = (a.information - b.information).cwiseAbs();
  return (a.mean - b.mean).cwiseAbs().maxCoeff() < 1e-4 &&
         (apart.array() <= 0.05 * b.information.cwiseAbs().array()).all();
}

bool same_kit(const Work& a, const Work& b) { return !a.kit.empty() && a.kit == b.kit; }

/// The very same flight? By content; profiles of old tell flights apart by name alone.
bool same_flight(const Work& work, const ProfileFactor& factor) {
  if (factor.digest.empty()) return work.name == factor.flight;
  return work.digest == factor.digest || work.dated_digest == factor.digest;
}

bool profile_fits(const Work& work, const FlightOptions& options) {
  return options.profile && (options.profile->kit.empty() || options.profile->kit == work.kit);
}

/// The flight that counts for this one: itself, or the one whose copy it is.
std::size_t original(const std::vector<Work>& all, std::size_t index) {
  return all[index].copy_of.value_or(index);
}

/// Factors of the other flights of the kit: those solved now, and the stored profile's; this very flight is
/// no other, and what is given twice counts once.
std::vector<ProfileFactor> others_of(const std::vector<Work>& all, std::size_t index,
                                     const FlightOptions& options) {
  std::vector<ProfileFactor> factors;
  std::set<std::string> counted{all[index].digest};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (i == original(all, index) || all[i].copy_of || !same_kit(all[i], all[index])) continue;
    counted.insert(all[i].digest);
    factors.push_back(all[i].factor);
  }
  if (!profile_fits(all[index], options)) return factors;
  for (const auto& factor : options.profile->factors) {
    const bool solved_now = std::ranges::any_of(
        all, [&](const Work& w) { return same_kit(w, all[index]) && same_flight(w, factor); });
    if (!solved_now && !same_flight(all[index], factor) &&
        (factor.digest.empty() || counted.insert(factor.digest).second))
      factors.push_back(factor);
  }
  return factors;
}

std::string sentence(const char* format, double a, double b = 0, double c = 0) {
  char text[600];
  std::snprintf(text, sizeof text, format, a, b, c);
  return text;
}

/// How well the arm is known: as asked for, else as the mission says. Where nobody said how the tag hangs and
/// no heading could show it, the regions hold where it may be.
void set_arm_sigma(const FlightData& flight, Work& work) {
  if (!work.options.lever_arm_sigma_m) work.options.lever_arm_sigma_m = flight.mission.lever_arm_sigma_m;
  if (!flight.mission.tags.empty() || work.rows.point == TrackPoint::tag_antenna ||
      work.rows.track.has_attitude() || work.options.lever_arm_sigma_m)
    return;
  work.options.lever_arm_sigma_m = k_undeclared_arm_sigma_m;
  work.rows.notes.push_back(sentence(
      "the track has no attitude and no lever arm is declared: a tag %.1f m beside the track point "
      "would move every anchor by up to %.1f m, heights by more where it turned with the course, and no "
      "range would show it, so the regions include "
      "%.2f m (one sigma) for it: declare the lever arm, even if it is zero, or how well it is "
      "known (lever_arm_sigma_m)",
      k_arm_asked_m, k_arm_asked_m, k_undeclared_arm_sigma_m));
}

/// What of the given knowledge about the kit was not used, for people.
void note_unused(std::vector<Work>& all, const FlightOptions& options) {
  for (Work& work : all) {
    if (work.copy_of) work.rows.notes.push_back(copy_note(all[*work.copy_of].name));
    if (options.profile && !profile_fits(work, options)) {
      work.rows.notes.push_back("the profile is of kit '" + options.profile->kit + "', this flight of kit '" +
                                work.kit + "': not used");
    }
  }
}

std::size_t n_believed(const FlightRows& flight) {
  std::size_t n = 0;
  for (const AnchorRows& anchor : flight.anchors) {
    n += static_cast<std::size_t>(
        std::ranges::count_if(anchor.rows, [](const JointRow& row) { return row.error_model != nullptr; }));
  }
  return n;
}

/// Lets go of the anchor's rows: what is said of each range takes their place in memory.
AnchorSolution assessed(Work& work, std::size_t index) {
  AnchorSolution anchor = assess_anchor(work.rows, work.fit, index, work.options);
  work.rows.anchors[index].rows = {};
  return anchor;
}

/// What the whole kit shares, as the fit has it.
SharedSolution shared_of(const Work& work) {
  SharedSolution shared;
  const auto valued = [&](int i) {
    return Valued{work.fit.state.shared[i], std::sqrt(std::max(work.fit.shared_covariance(i, i), 0.0))};
  };
  shared.bias_m = valued(k_shared_bias);
  shared.curve_m = valued(k_shared_curve);
  shared.lag_s = valued(k_shared_lag);
  shared.lever_up_m = valued(k_shared_lever);
  for (std::size_t k = 0; k < work.rows.antennas.size(); ++k) {
    const int own = k_shared_antennas + static_cast<int>(k);
    Valued up = shared.lever_up_m;
    if (work.rows.antennas.size() > 1 && own < k_shared_size) {
      const auto& c = work.fit.shared_covariance;
      up.value += work.fit.state.shared[own];
      up.sigma = std::sqrt(
          std::max(c(k_shared_lever, k_shared_lever) + c(own, own) + 2 * c(k_shared_lever, own), 0.0));
    }
    shared.lever_up_by_antenna.push_back({work.rows.antennas[k].tag, work.rows.antennas[k].antenna, up});
  }
  if (work.options.lever_across_prior_m > 0) {
    shared.lever_forward_m = valued(k_shared_forward);
    shared.lever_left_m = valued(k_shared_left);
  }
  shared.lever_arm_sigma_m = work.options.lever_arm_sigma_m;
  if (work.errors) {
    shared.range_scale = {work.errors->scale.value, work.errors->scale.sigma};
    shared.range_scale_z = work.errors->scale.z;
  }
  shared.bias_z = work.gate.z;
  shared.bias_determined = work.options.fixed_bias_m || work.gate.known;
  return shared;
}

/// Asks whether the track came back from each of its gaps where it was; the regions hold what the ranges
/// cannot exclude.
void ask_shift(const FlightData& flight, Work& work) {
  const auto breaks = track_breaks(work.rows, flight.fixes, work.options.min_fix);
  auto shift = check_track_shift(work.rows, breaks, work.fit, work.prior, work.options);
  if (!shift) return;
  work.checks.push_back(std::move(shift->gate));
  if (shift->note) work.rows.notes.push_back(std::move(*shift->note));
  work.shift_m2 = std::move(shift->covariance_m2);
  for (std::size_t i = 0; i < work.shift_m2.size(); ++i)
    work.fit.anchor_covariance[i].topLeftCorner<3, 3>() += work.shift_m2[i];
}

/// Asks the ranges for systematic errors; the regions hold what they cannot exclude.
Result<void> ask_errors(Work& work) {
  BOOST_OUTCOME_TRY(work.errors, check_systematic_errors(work.rows, work.fit, work.prior, work.options));
  if (work.errors->note) work.rows.notes.push_back(*work.errors->note);
  for (std::size_t i = 0; i < work.errors->covariance_m2.size(); ++i)
    work.fit.anchor_covariance[i].topLeftCorner<3, 3>() += work.errors->covariance_m2[i];
  return boost::outcome_v2::success();
}

/// Doubt about the track, which error_budgets takes for that of the ranges.
void move_shift_part(const Eigen::Matrix3d& shift_m2, ErrorBudget& budget) {
  budget.part(ErrorSource::bias) -= shift_m2;
  budget.part(ErrorSource::rtk) += shift_m2;
}

FlightSolution describe(Work& work, const FlightData& flight) {
  const FlightOptions& options = work.options;
  FlightSolution solution;
  solution.mission = flight.mission.id;
  solution.name = flight.mission.name;
  if (work.rows.frame) solution.origin = work.rows.frame->origin();
  const Unplaced unplaced = unplaced_of(work.rows, flight, options);
  solution.placed = unplaced.n_placed > 0 || unplaced.n_ranges == 0;
  if (!unplaced.why.empty()) solution.notes.push_back(unplaced.why);
  solution.notes.insert(solution.notes.end(), flight.notes.begin(), flight.notes.end());
  solution.notes.insert(solution.notes.end(), work.rows.notes.begin(), work.rows.notes.end());
  solution.shared = shared_of(work);
  if (!work.rows.pairs.empty()) {
    solution.notes.push_back(std::to_string(work.rows.pairs.size()) +
                             " distances between anchors took part in the solve");
  }
  if (const std::size_t n = n_believed(work.rows); n > 0) {
    solution.notes.push_back(std::to_string(n) +
                             " ranges were weighted by the likelihood of a model, not by the loss");
  }
  if (!solution.shared.bias_determined) {
    solution.notes.push_back(
        sentence("bias not determined by this flight, profile missing: %.3f m with sigma %.3f m (z %.1f)",
                 work.gate.bias_m, work.gate.sigma_m, work.gate.z));
  }
  for (const Gate& check : work.checks) {
    if (!check.passed) solution.notes.push_back(check.why);
  }
  if (!work.fit.converged) {
    solution.notes.push_back("the joint solve did not converge within " + std::to_string(work.fit.rounds) +
                             " rounds");
  }
  auto budgets = error_budgets(work.rows, work.fit, work.prior, options);
  for (std::size_t i = 0; i < work.rows.anchors.size(); ++i) {
    AnchorSolution anchor = assessed(work, i);
    if (anchor.estimate.best) {
      auto& gates = anchor.estimate.gates;
      gates.insert(gates.end(), work.checks.begin(), work.checks.end());
      if (!work.unseen_arm.empty()) gates.push_back(work.unseen_arm[i]);
      if (work.errors) gates.insert(gates.end(), work.errors->gates[i].begin(), work.errors->gates[i].end());
      anchor.budget = std::move(budgets[i]);
      if (!work.shift_m2.empty()) move_shift_part(work.shift_m2[i], *anchor.budget);
      name_largest_part(anchor.estimate, *anchor.budget);
    }
    anchor.search = std::move(work.start.searches[i]);
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
  solution.n_ranges = flight.n_ranges();
  solution.n_fixes = flight.fixes.size();
  return solution;
}

void note_wider(Work& work, std::size_t n_wider, const char* why) {
  if (n_wider == 0) return;
  work.rows.notes.push_back(std::to_string(n_wider) + " of " + std::to_string(work.rows.anchors.size()) +
                            " anchors are less certain because " + why);
}

/// Delays that the ranges may hide: the regions hold them.
void add_delay_doubts(Work& work) {
  const auto note = [&](std::size_t n_wider, const char* why) { note_wider(work, n_wider, why); };
  note(
      add_scatter_doubt(work.rows, work.prior, work.options, work.fit),
      "their ranges scatter more from some directions than from others: an obstacle there may lengthen them");
  note(add_sector_doubt(work.rows, work.options, work.fit),
       "their ranges fit better if those from one side are too long: an obstacle there may lengthen them");
  note(add_direction_doubt(work.rows, work.options, work.fit),
       "the errors of their ranges depend on the direction: walls and a roof may lengthen them");
  note(add_own_delay_doubt(work.rows, work.options, work.fit),
       "their ranges want a delay of their own: antenna delay, cable, firmware or a wall before one anchor");
}

/// Between the questions: each of them looks at all anchors.
Result<void> go_on(const FlightOptions& options) {
  if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
  return boost::outcome_v2::success();
}

/// What is asked of a flight as a whole, after all of them are solved.
Result<void> check_flight(const FlightData& flight, std::vector<Work>& all, std::size_t i,
                          const FlightOptions& options) {
  Work& work = all[i];
  BOOST_OUTCOME_TRY(const auto arm, check_lever_arm(work.rows, work.fit, work.prior, work.options));
  if (arm) work.checks.push_back(*arm);
  BOOST_OUTCOME_TRYV(go_on(options));
  if (const auto clock = check_clock(work.rows, work.fit)) work.checks.push_back(*clock);
  add_arm_doubt(work.rows, work.prior, work.options, work.fit);
  work.unseen_arm = unseen_arm_gates(work.rows, work.fit, work.prior, work.options);
  BOOST_OUTCOME_TRY(ask_errors(work));
  BOOST_OUTCOME_TRYV(go_on(options));
  ask_shift(flight, work);
  note_wider(work, add_level_doubt(work.rows, work.options, work.fit),
             "their ranges fit better if those from above or below some height are too long: a roof, beam or "
             "slab may lengthen them");
  if (work.rows.step_share > 0) work.checks.push_back(check_steps(work.rows.step_share, options));
  const auto others = others_of(all, i, options);
  if (!others.empty() && !options.fixed_bias_m)
    work.checks.push_back(check_profile(work.alone, others, options));
  return boost::outcome_v2::success();
}

}  // namespace

Result<void> FlightOptions::check() const {
  const auto positive = [](double v) { return std::isfinite(v) && v > 0; };
  const bool good =
      positive(bias_prior_m) && positive(calibrated_bias_prior_m) && positive(delay_prior_m) &&
      positive(curve_prior_m) && positive(lag_prior_s) && positive(lever_prior_m) && positive(mad_factor) &&
      positive(min_scale_m) && correlation_s >= 0 && floor_sigma_m >= 0 && min_range_m >= 0 &&
      max_range_m > min_range_m && (!lever_arm_sigma_m || is_lever_arm_sigma(*lever_arm_sigma_m)) &&
      (!max_gap_s || positive(*max_gap_s)) && positive(track.max_speed_mps) &&
      positive(track.max_acceleration_mps2) && positive(track.max_correction_age_s) &&
      (!anchor_height_m || std::isfinite(*anchor_height_m)) && positive(anchor_height_sigma_m) &&
      (!height_prior || (std::isfinite(height_prior->height_m) && positive(height_prior->sigma_m)));
  if (anchor_height_m && dims != Dims::two)
    return make_error(Errc::invalid_argument,
                      "a held anchor height needs two dimensions: set dims to 2, or give a height prior");
  if (height_prior && dims == Dims::two)
    return make_error(Errc::invalid_argument,
                      "a height prior needs three dimensions: set dims to 3, or hold the height instead");
  if (fixed_bias_m && !(std::abs(*fixed_bias_m) <= k_most_bias_m)) {
    return make_error(Errc::invalid_argument,
                      "range bias " + std::to_string(*fixed_bias_m) + " m: must be -200 to 200 m");
  }
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
    if (const auto& sigma_m = flight->mission.lever_arm_sigma_m; sigma_m && !is_lever_arm_sigma(*sigma_m))
      return make_error(Errc::invalid_argument,
                        flight->mission.name + ": lever_arm_sigma_m " + k_lever_arm_sigma_rule);
    auto rows = flight_rows(*flight, options);
    if (!rows) return make_error(rows.error().code, flight->mission.name + ": " + rows.error().message);
    Work work{.rows = std::move(rows.value())};
    work.options = in_frame_of(work.rows, options);
    set_arm_sigma(*flight, work);
    work.kit = flight->mission.kit;
    work.name = flight->mission.name;
    work.digest = flight_digest(*flight);
    if (options.profile) work.dated_digest = dated_flight_digest(*flight);
    all.push_back(std::move(work));
  }
  const auto copies = flight_copies(flights);
  for (std::size_t i = 0; i < all.size(); ++i) all[i].copy_of = copies[i];
  note_unused(all, options);
  for (Work& work : all) {
    BOOST_OUTCOME_TRY(solve_with(work, for_antennas(wide_prior(options), work)));
    if (work.antennas() > 1 && !shows_antennas_apart(work)) {
      work.antennas_apart = false;
      BOOST_OUTCOME_TRY(solve_with(work, for_antennas(wide_prior(options), work)));
    }
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
      priors.push_back(for_antennas(profile_prior(factors, all[i].gate, options), all[i]));
    }
    for (std::size_t i = 0; i < all.size(); ++i) {
      // A flight whose gate changed next to nothing is solved already.
      if (about_same(priors[i], all[i].prior)) continue;
      BOOST_OUTCOME_TRY(solve_with(all[i], priors[i]));
    }
  }
  if (!options.fixed_bias_m) {
    for (Work& work : all) add_doubt(work.fit, work.gate);
  }
  for (Work& work : all) {
    BOOST_OUTCOME_TRYV(go_on(options));
    add_delay_doubts(work);
  }
  for (std::size_t i = 0; i < all.size(); ++i) {
    BOOST_OUTCOME_TRY(check_flight(*flights[i], all, i, options));
  }
  if (profile) {
    profile->kit = all.empty() ? "" : all.front().kit;
    profile->factors = all.empty() ? std::vector<ProfileFactor>{} : others_of(all, 0, options);
    if (!all.empty()) profile->factors.push_back(all[original(all, 0)].factor);
  }
  BOOST_OUTCOME_TRYV(go_on(options));
  std::vector<FlightSolution> solutions;
  for (std::size_t i = 0; i < all.size(); ++i) solutions.push_back(describe(all[i], *flights[i]));
  return solutions;
}

}  // namespace anchord
