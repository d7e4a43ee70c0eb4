#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>

#include "core/localize/flight_solver.hpp"

namespace anchord {

/// How the dissertation solves an anchor (chapter 7), beside how this product does.
enum class AnchorMethod : std::uint8_t {
  joint,   ///< solve_flight: all anchors with bias, curve, lag and arms
  linear,  ///< eq 7.2 to 7.5, closed form
  wls      ///< eq 7.10, weighted nonlinear least squares of each anchor alone
};
inline constexpr auto k_anchor_method_words = enum_table<AnchorMethod>(
    {{"joint", AnchorMethod::joint}, {"linear", AnchorMethod::linear}, {"wls", AnchorMethod::wls}});

/// One anchor by the methods that know nothing of bias, lag or outliers; the joint answer is its Estimate's.
struct MethodAnswers {
  std::optional<Eigen::Vector3d> linear_m{}, wls_m{};  ///< frame of the joint answer
  std::optional<Eigen::Matrix3d> wls_covariance_m2{};
  std::string why;  ///< why one of them is missing
};

/// Ranges as given (corrections of models included), on the track as stamped, with the weights of 7.2.3: LOS
/// 2401 mm^2, NLOS 54550 mm^2 by what a model believes (without one all are LOS), RTK 400 mm^2. wls begins at
/// the linear answer.
/// origin  of the joint answer
/// errors  of flight_rows
Result<std::map<NetworkId, MethodAnswers>> compare_methods(const FlightData& flight,
                                                           const FlightOptions& options,
                                                           const std::optional<Wgs84>& origin);

/// The solution with the positions of another method in place of its own. Such an answer is for comparison:
/// it fails gate `method`, whatever it is. joint: as it is.
void answer_by(AnchorMethod method, const std::map<NetworkId, MethodAnswers>& answers,
               FlightSolution& solution);

}  // namespace anchord
