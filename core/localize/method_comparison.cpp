#include "core/localize/method_comparison.hpp"

#include <cmath>
#include <limits>

#include "core/geo/enu.hpp"
#include "core/localize/error_ellipse.hpp"
#include "core/localize/flight_rows.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/solver.hpp"

namespace anchord {
namespace {

std::vector<Observation> observations(const FlightRows& flight, const AnchorRows& anchor) {
  std::vector<Observation> all;
  for (const JointRow& row : anchor.rows) {
    const TagPoint point = flight.track.at(row.t_s, row.lever_arm_body_m);
    if (point.refused != TrackRefusal::none) continue;
    const double p_los = row.error_model ? row.error_model->p_los : 1.0;
    Observation o;
    o.tag_m = point.position_m;
    o.distance_m = row.distance_m;
    o.sigma_m = std::sqrt(p_los * k_variance_los_m2 + (1 - p_los) * k_variance_nlos_m2 + k_variance_rtk_m2);
    all.push_back(o);
  }
  return all;
}

MethodAnswers answers_of(const std::vector<Observation>& rows, const FlightOptions& options,
                         const std::optional<double>& height_m) {
  MethodAnswers out;
  auto linear = linear_position(rows, options.dims);
  if (!linear) {
    out.why = "linear: " + linear.error().message;
    return out;
  }
  if (height_m) linear.value().z() = *height_m;
  out.linear_m = linear.value();
  SolverOptions settings;
  settings.dims = options.dims;
  settings.weights = options.weights;
  const auto fit = solve_anchor(rows, linear.value(), settings);
  if (!fit) {
    out.why = "wls: " + fit.error().message;
    return out;
  }
  out.wls_m = fit.value().position_m;
  out.wls_covariance_m2 = fit.value().covariance_m2;
  return out;
}

}  // namespace

Result<std::map<NetworkId, MethodAnswers>> compare_methods(const FlightData& flight,
                                                           const FlightOptions& options,
                                                           const std::optional<Wgs84>& origin) {
  FlightOptions here = options;
  if (origin) here.origin = origin;
  BOOST_OUTCOME_TRY(const auto rows, flight_rows(flight, here));
  std::optional<double> height_m;
  if (options.dims == Dims::two) {
    double sum_m = 0;
    for (const auto& pose : rows.track.poses()) sum_m += pose.position_m.z();
    height_m = options.anchor_height_m
                   ? *options.anchor_height_m - (rows.frame ? rows.frame->origin().height_m : 0.0)
                   : sum_m / static_cast<double>(rows.track.poses().size());
  }
  std::map<NetworkId, MethodAnswers> out;
  for (const AnchorRows& anchor : rows.anchors)
    out[anchor.id] = answers_of(observations(rows, anchor), options, height_m);
  return out;
}

void answer_by(AnchorMethod method, const std::map<NetworkId, MethodAnswers>& answers,
               FlightSolution& solution) {
  if (method == AnchorMethod::joint) return;
  const bool linear = method == AnchorMethod::linear;
  for (AnchorSolution& anchor : solution.anchors) {
    Estimate& e = anchor.estimate;
    const auto found = answers.find(e.anchor);
    const auto place = found == answers.end() ? std::nullopt
                       : linear               ? found->second.linear_m
                                              : found->second.wls_m;
    anchor.budget.reset();
    anchor.residuals.clear();
    anchor.delay_m.reset();
    anchor.delay_sigma_m.reset();
    e.mirror.reset();
    e.bias_m = e.bias_sigma_m = e.lag_s = e.lag_sigma_s = std::nullopt;
    e.gates = {
        {"method", std::nullopt, 0, false,
         linear
             ? "linear least squares (eq 7.2 to 7.5), for comparison: bias, lag and outliers are not handled"
             : "weighted least squares of each anchor alone (eq 7.10), for comparison: bias, lag and "
               "outliers are not handled"}};
    if (!place) {
      e.best.reset();
      e.verdict = Verdict::diverged;
      e.reason = found == answers.end() ? "no ranges" : found->second.why;
      anchor.determined = Determined::none;
      continue;
    }
    Hypothesis best;
    best.position.m = *place;
    if (solution.origin) best.wgs84 = EnuFrame(*solution.origin).wgs84_from_enu(best.position);
    best.rms_residual_m = std::numeric_limits<double>::quiet_NaN();
    best.covariance_m2.setConstant(std::numeric_limits<double>::quiet_NaN());
    e.h95_m = e.v95_m = std::numeric_limits<double>::quiet_NaN();
    if (!linear && found->second.wls_covariance_m2) {
      best.covariance_m2 = *found->second.wls_covariance_m2;
      const ErrorEllipse ellipse = error_ellipse(best.covariance_m2);
      e.h95_m = ellipse.h95_m;
      e.v95_m = ellipse.v95_m;
    }
    e.best = best;
    e.verdict = Verdict::ok;
    e.reason.clear();
    anchor.determined = Determined::position;
  }
}

}  // namespace anchord
