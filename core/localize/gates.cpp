#include "core/localize/gates.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "core/localize/chi_square.hpp"
#include "core/localize/error_model_likelihood.hpp"
#include "core/localize/geometry.hpp"
#include "core/localize/held_height.hpp"
#include "core/localize/joint_lines.hpp"
#include "core/localize/own_delay.hpp"
#include "core/localize/residual.hpp"
#include "core/localize/second_place.hpp"
#include "core/localize/solver.hpp"

namespace anchord {
namespace {

template <class... Numbers>
std::string text(const char* format, Numbers... numbers) {
  char buffer[240];
  std::snprintf(buffer, sizeof buffer, format, numbers...);
  return buffer;
}

Gate at_least(std::string name, double value, double limit, std::string why) {
  return {std::move(name), value, limit, value >= limit, std::move(why)};
}
Gate at_most(std::string name, double value, double limit, std::string why) {
  return {std::move(name), value, limit, value <= limit, std::move(why)};
}

/// Quantile of the standard normal, Abramowitz and Stegun 26.2.23: error below 4.5e-4.
double normal_quantile(double probability) {
  const double tail = std::min(probability, 1.0 - probability);
  const double t = std::sqrt(-2.0 * std::log(std::max(tail, 1e-300)));
  const double z =
      t - (2.515517 + t * (0.802853 + t * 0.010328)) / (1.0 + t * (1.432788 + t * (0.189269 + t * 0.001308)));
  return probability < 0.5 ? -z : z;
}

/// Means of the residuals in windows of two correlation times.
Gate chi_square(const AnchorSolution& solution, const FlightOptions& options, const GateLimits& limits) {
  const double window_s = std::max(2.0 * options.correlation_s, 1.0);
  double chi2 = 0;
  int windows = 0;
  double sum = 0, weight = 0;
  const RangeResidual* first = nullptr;
  const auto close = [&] {
    if (weight > 0) {
      const double mean_m = sum / weight;
      chi2 += mean_m * mean_m / (solution.residual_scale_m * solution.residual_scale_m);
      ++windows;
    }
    sum = weight = 0;
  };
  for (const auto& row : solution.residuals) {
    if (first && seconds_between(first->time, row.time) > window_s) {
      close();
      first = nullptr;
    }
    if (!first) first = &row;
    sum += row.weight * row.residual_m;
    weight += row.weight;
  }
  close();
  const double dof = std::max(windows - 3, 1);
  return at_most(
      "chi_square", chi2, chi2_quantile(limits.probability, dof),
      text("residual means over %.0f s against a scale of %.3f m: chi2 %.1f, %.0f degrees of freedom",
           window_s, solution.residual_scale_m, chi2, dof));
}

/// What an anchor's ranges say of themselves, beside those of the flight's other anchors. All ranges through
/// one wall fit a place behind the anchor, and no residual is large: what shows is that they scatter more
/// than the others' and that, the place left free, they want to be shorter.
struct Lateness {
  double scale_ratio{};  ///< residual scale over the median of the others'; 0 with fewer than two of those
  double delay_m{}, delay_z{};  ///< own delay without its prior, in sigmas of that and of the prior
  bool blocked(const GateLimits& limits) const { return scale_ratio > limit(limits); }
  double limit(const GateLimits& limits) const {
    return delay_z > limits.late_z ? limits.late_scale_ratio : limits.scale_ratio;
  }
};

Lateness lateness_of(const JointFit& fit, std::size_t index, const FlightOptions& options) {
  Lateness out;
  const AnchorBlock& block = fit.normal.anchors[index];
  std::vector<double> others_m;
  for (std::size_t i = 0; i < fit.normal.anchors.size(); ++i) {
    if (i != index && fit.state.anchors[i].active) others_m.push_back(fit.normal.anchors[i].scale_m);
  }
  if (others_m.size() < 2) return out;
  const auto middle = others_m.begin() + static_cast<std::ptrdiff_t>((others_m.size() - 1) / 2);
  std::ranges::nth_element(others_m, middle);
  out.scale_ratio = block.scale_m / *middle;
  const auto own = own_delay(fit, index, options);
  if (!own) return out;
  out.delay_m = own->delay_m;
  const double bias_m2 = std::max(fit.shared_covariance(k_shared_bias, k_shared_bias), 0.0);
  out.delay_z = out.delay_m / std::sqrt(own->sigma_m * own->sigma_m +
                                        options.delay_prior_m * options.delay_prior_m + bias_m2);
  return out;
}

/// The anchor, and the company it is in: where a quarter of the anchors stand out, the bias they share with
/// the rest is drawn to theirs, and nobody is believed.
Gate blocked(const JointFit& fit, std::size_t index, const FlightOptions& options, const GateLimits& limits) {
  const Lateness own = lateness_of(fit, index, options);
  Gate gate = at_most("blocked", own.scale_ratio, own.limit(limits),
                      text("residuals %.1f times those of the other anchors; with a range bias of its own, "
                           "its ranges are %+.2f m too long (%.1f sigma)",
                           own.scale_ratio, own.delay_m, own.delay_z));
  std::size_t n = 0, n_blocked = 0;
  for (std::size_t i = 0; i < fit.normal.anchors.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    ++n;
    n_blocked += lateness_of(fit, i, options).blocked(limits) ? 1 : 0;
  }
  if (gate.passed && n_blocked > 1 && 4 * n_blocked >= n) {
    gate.passed = false;
    gate.why += text("; %zu of %zu anchors stand out like this", n_blocked, n);
  }
  return gate;
}

/// Of two answers about one anchor: how far apart they are along some axes, and how far they may be.
struct MovedTest {
  const char* axes;
  double chi2, limit;
};

struct Half {
  Eigen::Vector3d position_m;
  Eigen::Matrix3d covariance_m2;
};

/// The anchor from some of its rows, everything shared held; covariance tempered like the whole.
std::optional<Half> solve_half(std::vector<Observation> rows, const Eigen::Vector3d& start,
                               const AnchorBlock& block, std::size_t of_rows, const FlightOptions& options) {
  if (rows.size() < 10) return std::nullopt;
  const double stands_for =
      static_cast<double>(block.n_in_track) / (static_cast<double>(of_rows) * block.kappa);
  SolverOptions settings;
  settings.dims = options.dims;
  settings.estimate_bias = true;
  settings.bias_prior_sigma_m = options.delay_prior_m * std::sqrt(stands_for);
  // Cauchy: a half in which the anchor stood elsewhere must not lose all its rows to the other's place.
  settings.loss = Loss::cauchy;
  settings.loss_sigmas = 2.0;
  settings.step_tolerance_m = 1e-4;
  const auto fit = solve_anchor_gauss_newton(rows, start, settings);
  if (!fit) return std::nullopt;
  return Half{fit.value().position_m, fit.value().covariance_m2 / stands_for};
}

Gate halves(const FlightRows& flight, const JointFit& fit, std::size_t index, const FlightOptions& options,
            const GateLimits& limits) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const auto rows =
      observations_of(flight, flight.anchors[index], fit.state.shared, 800, std::max(block.scale_m, 1e-3));
  const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(rows.size() / 2);
  const Eigen::Vector3d& at = fit.state.anchors[index].position_m;
  const auto early = solve_half({rows.begin(), middle}, at, block, rows.size(), options);
  const auto late = solve_half({middle, rows.end()}, at, block, rows.size(), options);
  const double limit = chi2_quantile(limits.probability, options.dims == Dims::two ? 2 : 3);
  if (!early || !late) {
    return {"halves", std::nullopt, limit, false,
            std::string(early ? "the second" : "the first") + " half of the flight alone gives no position"};
  }
  const Eigen::Vector3d apart = late->position_m - early->position_m;
  Eigen::Matrix3d both = early->covariance_m2 + late->covariance_m2;
  both.diagonal().array() += 2.0 * options.floor_sigma_m * options.floor_sigma_m + 1e-12;
  const double chi2 = apart.dot(both.ldlt().solve(apart));
  return at_most("halves", chi2, limit,
                 text("the two halves of the flight place it %.2f m apart (%.2f m horizontally): chi2 %.1f",
                      apart.norm(), apart.head<2>().norm(), chi2));
}

}  // namespace

double chi2_quantile(double probability, double dof) {
  const double a = 2.0 / (9.0 * dof);
  const double root = 1.0 - a + normal_quantile(probability) * std::sqrt(a);
  return dof * root * root * root;
}

std::vector<Gate> gates_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                           const AnchorSolution& solution, const FlightOptions& options,
                           const GateLimits& limits) {
  const Estimate& estimate = solution.estimate;
  const AnchorBlock& block = fit.normal.anchors[index];
  const double unknowns = options.dims == Dims::two ? 3 : 4;
  const double used = static_cast<double>(block.n_used);
  std::vector<Gate> gates;
  gates.push_back(at_least("redundancy", used - unknowns, limits.redundancy,
                           text("%.0f ranges used for %.0f unknowns", used, unknowns)));
  if (!estimate.best) return gates;
  const double share = static_cast<double>(block.n_rejected) / static_cast<double>(block.n_in_track);
  gates.push_back(at_most("rejected", share, limits.rejected_share,
                          text("%.1f %% of %zu ranges rejected", 100 * share, block.n_in_track)));
  const GeometryLimits geometry;
  gates.push_back(at_least("geometry", solution.geometry.line_ratio, geometry.line,
                           "width of the track across its main direction over the median range"));
  // Of the height too: where a flight cannot tell height from bias, a wrong bias goes there unseen.
  const double largest_m = std::sqrt(std::max(
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(estimate.best->covariance_m2).eigenvalues().maxCoeff(),
      0.0));
  const double spread = options.dims == Dims::two
                            ? solution.geometry.sigma_ratio
                            : largest_m / std::max(solution.geometry.median_range_m, 1e-3);
  gates.push_back(at_most("precision", spread, limits.precision,
                          "largest sigma (height included) over the median range"));
  const bool plane = options.dims == Dims::three && solution.determined == Determined::horizontal;
  const double side = plane && !estimate.mirror ? 0.5 : estimate.best->probability;
  gates.push_back(at_least("side", side, limits.side_probability,
                           estimate.mirror
                               ? "probability of this solution; the other one is given as the mirror solution"
                               : "no mirror solution fits as well"));
  if (plane && !estimate.mirror) gates.back().why = "the track is a plane: height not determined";
  if (options.dims == Dims::two) gates.push_back(held_height_gate(options));
  if (!options.outline_m.empty()) {
    const double outside_m = outside_outline_m(options.outline_m, estimate.best->position.m);
    gates.push_back(
        at_most("outline", outside_m, limits.outline_sigmas * options.outline_sigma_m,
                text("%.2f m outside of the building's outline, which was a prior with sigma %.1f m",
                     outside_m, options.outline_sigma_m)));
  }
  // What a model has judged is corrected and weighed as what it is: late ranges are no surprise there.
  if (!mostly_modelled(flight.anchors[index])) {
    gates.push_back(blocked(fit, index, options, limits));
    if (auto own = own_delay_gate(flight, fit, index, options)) gates.push_back(std::move(*own));
  }
  gates.push_back(at_most("residual_scale", solution.residual_scale_m, limits.residual_scale_m,
                          "1.4826 x median absolute residual, metres"));
  gates.push_back(chi_square(solution, options, limits));
  gates.push_back(halves(flight, fit, index, options, limits));
  gates.push_back(second_place_gate(flight, fit, index, options));
  const double bias_sigma_m = std::sqrt(std::max(fit.shared_covariance(k_shared_bias, k_shared_bias), 0.0));
  gates.push_back(at_most(
      "bias", bias_sigma_m, 2.0 * options.bias_known_sigma_m,
      text("range bias of the kit %.3f m with sigma %.3f m", fit.state.shared[k_shared_bias], bias_sigma_m)));
  if (!fit.converged)
    gates.push_back(
        {"settled", static_cast<double>(fit.rounds), 60, false, "the joint solve did not converge"});
  return gates;
}

Gate moved_gate(const Estimate& now, const Estimate& before, const GateLimits& limits) {
  const double in_space = chi2_quantile(limits.probability, 3);
  if (!now.best || !before.best)
    return {"flights", std::nullopt, in_space, false, "one of them has no position"};
  const Eigen::Vector3d apart = now.best->position.m - before.best->position.m;
  const Eigen::Matrix3d both = now.best->covariance_m2 + before.best->covariance_m2;
  const Eigen::Matrix2d level = both.topLeftCorner<2, 2>();
  // Of three axes together a height alone may be off by four of its sigmas.
  const double one_axis = normal_quantile(0.5 + 0.5 * limits.probability);
  const std::array tests{
      MovedTest{"", apart.dot(both.ldlt().solve(apart)), in_space},
      MovedTest{" horizontally", apart.head<2>().dot(level.ldlt().solve(apart.head<2>())),
                chi2_limit(true, limits)},
      MovedTest{" in height", apart.z() * apart.z() / both(2, 2), one_axis * one_axis},
  };
  if (!std::ranges::all_of(tests, [](const MovedTest& t) { return std::isfinite(t.chi2); }))
    return {"flights", std::nullopt, in_space, false, "a covariance is singular"};
  const MovedTest worst = std::ranges::max(tests, {}, [](const MovedTest& t) { return t.chi2 / t.limit; });
  return at_most(
      "flights", worst.chi2, worst.limit,
      text("%.3f m from the earlier position (%.3f m horizontally, %+.3f m in height): chi2%s %.1f%s",
           apart.norm(), apart.head<2>().norm(), apart.z(), worst.axes, worst.chi2,
           worst.chi2 > worst.limit ? ": it has moved, or one of the two is wrong" : ""));
}

Gate flights_gate(double chi2, std::size_t n_flights, const GateLimits& limits) {
  const double dof = 3.0 * static_cast<double>(n_flights - 1);
  return at_most("flights", chi2, chi2_quantile(limits.probability, dof),
                 text("%zu flights around their common position: chi2 %.1f with %.0f degrees of freedom",
                      n_flights, chi2, dof));
}

Gate ambiguous_flight_gate(double chi2, double apart_m, const GateLimits& limits) {
  return at_most(
      "flights", chi2, chi2_quantile(limits.probability, 2),
      text(
          "a flight that leaves its height open has it %.2f m away horizontally: chi2 %.1f with 2 degrees of "
          "freedom",
          apart_m, chi2));
}

std::vector<RangeResidual> residuals_of(const FlightRows& flight, const JointFit& fit, std::size_t index,
                                        const FlightOptions& options) {
  const AnchorBlock& block = fit.normal.anchors[index];
  const JointState::Anchor& anchor = fit.state.anchors[index];
  std::vector<RangeResidual> all;
  const JointLines lines(flight.track, flight.anchors[index].rows, fit.state.shared, anchor);
  all.reserve(lines.size());
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const JointRow& row = *lines.rows()[i];
    const JointLine line = lines.line(i);
    const double extra_m2 = std::max(line.position_variance_m2 - block.usual_position_variance_m2, 0.0);
    const double sigma2 = block.scale_m * block.scale_m + extra_m2;
    const double leverage = line.by_anchor.dot(block.own_inverse * line.by_anchor) / (block.kappa * sigma2);
    RangeResidual one;
    one.time = UtcTime{flight.epoch.ns + std::llround(row.t_s * 1e9)};
    one.tag = row.tag;
    one.antenna = row.antenna;
    one.tag_m = line.antenna_m;
    one.distance_m = row.received_m;
    one.residual_m = line.residual_m;
    one.corrected_m = line.residual_m + (line.antenna_m - anchor.position_m).norm();
    one.sigma_m = std::sqrt(sigma2);
    one.weight = robust_weight(line.residual_m / std::sqrt(sigma2), options);
    if (row.error_model) {
      one.p_los = error_model_value(*row.error_model, line.residual_m, line.position_variance_m2).p_los;
      one.weight = *one.p_los;
    }
    one.standardised = line.residual_m / std::sqrt(sigma2 * std::max(1.0 - leverage, 0.05));
    all.push_back(one);
  }
  return all;
}

}  // namespace anchord
