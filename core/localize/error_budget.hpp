#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/localize/joint_model.hpp"

namespace anchord {

/// Where the uncertainty of a position comes from, in the order they are shown.
enum class ErrorSource : std::uint8_t { ranging, geometry, bias, rtk, lever_arm, clock, base, floor };
inline constexpr auto k_error_source_words = enum_table<ErrorSource>({{"ranging", ErrorSource::ranging},
                                                                      {"geometry", ErrorSource::geometry},
                                                                      {"bias", ErrorSource::bias},
                                                                      {"rtk", ErrorSource::rtk},
                                                                      {"lever_arm", ErrorSource::lever_arm},
                                                                      {"clock", ErrorSource::clock},
                                                                      {"base", ErrorSource::base},
                                                                      {"floor", ErrorSource::floor}});
inline constexpr std::size_t k_error_sources = k_error_source_words.size();
/// In words for people: "geometry of the flight".
std::string_view source_text(ErrorSource source);

/// What would lower it most.
enum class BudgetHelp : std::uint8_t {
  more_points,     ///< more ranges from about where they are
  other_height,    ///< the weak direction is up
  other_sides,     ///< the weak direction is horizontal
  calibrate_bias,  ///< a profile of the kit, or models of blocked ranges
  better_rtk,
  calibrate_arm,
  fix_clock,
  survey_base,
  check_points  ///< what remains is in no residual: only points known otherwise can show it
};
inline constexpr auto k_budget_help_words =
    enum_table<BudgetHelp>({{"more_points", BudgetHelp::more_points},
                            {"other_height", BudgetHelp::other_height},
                            {"other_sides", BudgetHelp::other_sides},
                            {"calibrate_bias", BudgetHelp::calibrate_bias},
                            {"better_rtk", BudgetHelp::better_rtk},
                            {"calibrate_arm", BudgetHelp::calibrate_arm},
                            {"fix_clock", BudgetHelp::fix_clock},
                            {"survey_base", BudgetHelp::survey_base},
                            {"check_points", BudgetHelp::check_points}});
std::string_view help_text(BudgetHelp help);

/// The covariance of one position, taken apart. The parts are positive semidefinite and their sum is the
/// covariance claimed, plus the base's where that is known.
struct ErrorBudget {
  std::array<Eigen::Matrix3d, k_error_sources> parts_m2;
  Eigen::Vector3d weak{0, 0, 1};  ///< direction in which the geometry is weakest, unit length

  ErrorBudget() { parts_m2.fill(Eigen::Matrix3d::Zero()); }
  Eigen::Matrix3d& part(ErrorSource source) { return parts_m2[static_cast<std::size_t>(source)]; }
  double trace_m2(ErrorSource source) const { return parts_m2[static_cast<std::size_t>(source)].trace(); }
  double trace_m2() const;
  double share(ErrorSource source) const;  ///< of the whole trace
  ErrorSource largest() const;
  BudgetHelp help() const;
};

/// Budgets of every anchor of a fit.
///
/// bias, clock, lever_arm  the covariance that goes when the source is known perfectly: bias, curve and unit
///     delays; lag; vertical (and freed horizontal) arm. What two of them hide from each other is split
///     evenly (mean over the orders in which they become known, Shapley). To the bias belong the doubt
///     whether the kit is calibrated (kit_prior.hpp) and that of ranges that scatter (scatter_doubt.hpp).
/// geometry  of what remains, C0: the part that would go had the ranges, as many and as good, come from
///     evenly spread directions: tr C0 - 9 / tr C0^-1 (in the plane 4 / tr)
/// rtk, ranging  the rest by the share of the track's variance along the line of sight in the residual
/// scale^2 floor    options.floor_sigma_m, which no residual shows base     zero here: who knows the site
/// adds it
///
/// fit      with its doubt added (add_doubt); prior: what it was solved with
std::vector<ErrorBudget> error_budgets(const FlightRows& flight, const JointFit& fit,
                                       const SharedPrior& prior, const FlightOptions& options);

/// One flight's answer about an anchor, for the budget of their fusion.
struct BudgetOf {
  const ErrorBudget* budget{};
  Eigen::Matrix3d covariance_m2;
};
/// Each source through the gain of the fusion: sum of G_i P_i G_i', G_i = C C_i^-1 with C the covariance of
/// the weighted mean, scaled to the fused covariance as it is claimed.
ErrorBudget fused_budget(std::span<const BudgetOf> flights, const Eigen::Matrix3d& fused_covariance_m2);

}  // namespace anchord
