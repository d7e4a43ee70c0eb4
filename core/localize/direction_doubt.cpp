#include "core/localize/direction_doubt.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/localize/column_factor.hpp"
#include "core/localize/joint_lines.hpp"
#include "core/localize/widen.hpp"

namespace anchord {
namespace {

constexpr double k_stretch_s = 2.5;      // the direction hardly changes
constexpr double k_most_stretches = 50;  // longer flights have longer stretches
constexpr std::size_t k_least_stretches = 12;
constexpr double k_field_alike_rad = 1.5;  // errors of walls: a quarter of the horizon each
constexpr double k_field_place_m = 5.0;
// Errors alike for some seconds, of a radio in the open and where echoes are; they compete with the field.
constexpr std::array<double, 3> k_field_slow_m{0.05, 0.1, 0.2};
constexpr std::array<double, 5> k_field_sizes_m{0.0, 0.08, 0.16, 0.32, 0.64};
constexpr double k_field_usual_m = 0.1;  // smaller ones are what antennas do everywhere, and claimed already

constexpr Eigen::Index k_field_unknowns = 7;  // place, unit delay, curve, lag, vertical arm
using FieldUnknowns = Eigen::Matrix<double, k_field_unknowns, 1>;

/// Some seconds of ranges, those that the loss keeps.
struct Stretch {
  double t_s{}, residual_m{}, n{};
  FieldUnknowns by{FieldUnknowns::Zero()};
  Eigen::Vector3d way{0, 0, 0};  ///< from the anchor
};

std::vector<Stretch> stretches_of(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                                  std::size_t index) {
  const JointLines lines(flight.track, flight.anchors[index].rows, fit.state.shared,
                         fit.state.anchors[index]);
  std::vector<Stretch> stretches;
  if (lines.size() == 0) return stretches;
  const double scale_m = fit.normal.anchors[index].scale_m;
  const double length_s =
      std::max(k_stretch_s, (lines.rows().back()->t_s - lines.rows().front()->t_s) / k_most_stretches);
  double begun_s = 0;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto value = [&](JointLines::Column column) { return lines.of(column)[i]; };
    const double residual_m = value(JointLines::residual), t_s = lines.rows()[i]->t_s;
    // The curve begins where ranges are no longer near: those err by their length, which a room of a few
    // metres turns into a direction.
    const bool near = !(value(JointLines::curve) > 0);
    if (near || lines.rows()[i]->error_model || !(robust_weight(residual_m / scale_m, options) > 0)) continue;
    if (stretches.empty() || t_s - begun_s >= length_s) {
      stretches.emplace_back();
      begun_s = t_s;
    }
    Stretch& last = stretches.back();
    FieldUnknowns by;
    by << value(JointLines::x), value(JointLines::y), value(JointLines::z), 1.0, value(JointLines::curve),
        value(JointLines::lag), value(JointLines::lever);
    if (options.dims == Dims::two) by[2] = 0;
    last.t_s += t_s;
    last.residual_m += residual_m;
    last.by += by;
    last.way -= Eigen::Vector3d(value(JointLines::x), value(JointLines::y), value(JointLines::z));
    last.n += 1;
  }
  for (Stretch& last : stretches) {
    last.t_s /= last.n;
    last.residual_m /= last.n;
    last.by /= last.n;
    last.way.normalize();
  }
  return stretches;
}

/// All stretches of an anchor, and what is known of them without a field.
struct Stretches {
  /// Of each the residual, then by what it changes.
  std::vector<ColumnFactor::Beside> beside;
  std::vector<double> noise_m2, alike_in_time, alike;  ///< the last two as ColumnFactor has its columns
  ColumnFactor factor;

  Stretches(const std::vector<Stretch>& stretches, double noise_m2_each) : factor(stretches.size()) {
    const std::size_t n = stretches.size(), stride = factor.stride();
    alike_in_time.resize(n * stride);
    alike.resize(n * stride);
    for (std::size_t k = 0; k < n; ++k) {
      const Stretch& b = stretches[k];
      beside.emplace_back() << b.residual_m, b.by;
      noise_m2.push_back(noise_m2_each / b.n);
      for (std::size_t i = k; i < n; ++i) {
        const Stretch& a = stretches[i];
        const double apart_rad = std::acos(std::clamp(a.way.dot(b.way), -1.0, 1.0));
        alike[k * stride + i] = std::exp(-apart_rad / k_field_alike_rad);
        alike_in_time[k * stride + i] = std::exp(-std::abs(a.t_s - b.t_s) / k_error_correlation_s);
      }
    }
  }
};

/// What a field of one size says.
struct FieldAnswer {
  double log_likelihood{};
  Eigen::Vector3d moved_m{0, 0, 0};
  Eigen::Matrix3d covariance_m2{Eigen::Matrix3d::Zero()};
};

using FieldInformation = Eigen::Matrix<double, k_field_unknowns, k_field_unknowns>;

FieldAnswer field_answer_of(Stretches& stretches, double slow_m, double size_m,
                            const FieldInformation& prior) {
  ColumnFactor& errors = stretches.factor;
  errors.factor(slow_m * slow_m, stretches.alike_in_time, size_m * size_m, stretches.alike,
                stretches.noise_m2, stretches.beside);
  const ColumnFactor::Products products = errors.products();
  // Walls are never early: the mean of what they do is about as large as what it differs by.
  const double delay_information = 1.0 / (1.0 / prior(3, 3) + size_m * size_m);
  FieldInformation normal = products.bottomRightCorner<k_field_unknowns, k_field_unknowns>() + prior;
  normal(3, 3) += delay_information - prior(3, 3);
  const Eigen::LLT<FieldInformation> solver(normal);
  const FieldUnknowns pull = products.bottomLeftCorner<k_field_unknowns, 1>();
  const FieldUnknowns step = solver.solve(pull);
  FieldAnswer answer;
  answer.log_likelihood = -errors.log_diagonal() - solver.matrixLLT().diagonal().array().log().sum() +
                          0.5 * std::log(delay_information) - 0.5 * (products(0, 0) - pull.dot(step));
  answer.moved_m = step.head<3>();
  answer.covariance_m2 = solver.solve(Eigen::Matrix<double, k_field_unknowns, 3>::Identity()).topRows<3>();
  return answer;
}

/// What is known beside the ranges: of the place by its priors, of the rest by what every kit is.
FieldInformation field_prior(const FlightRows& flight, const FlightOptions& options, const JointFit& fit,
                             std::size_t index) {
  const double bias_m2 = std::max(fit.shared_covariance(k_shared_bias, k_shared_bias), 0.0);
  FieldUnknowns sigma;
  sigma << Eigen::Vector3d::Constant(k_field_place_m),
      std::sqrt(options.delay_prior_m * options.delay_prior_m + bias_m2), options.curve_prior_m,
      options.lag_prior_s, options.lever_prior_m;
  FieldInformation prior = sigma.cwiseInverse().cwiseAbs2().asDiagonal();
  prior.topLeftCorner<3, 3>() += prior_normal(priors_of(flight.anchors[index].id, options), options.outline_m,
                                              options.outline_sigma_m, fit.state.anchors[index].position_m)
                                     .information;
  return prior;
}

/// Where the place may be, all sizes weighed. No field is as likely as one, of whatever size.
Eigen::Matrix3d field_held_m2(Stretches& stretches, const FieldInformation& prior,
                              const Eigen::Matrix3d& claimed_m2) {
  std::vector<std::pair<double, FieldAnswer>> answers;
  for (const double slow_m : k_field_slow_m)
    for (const double size_m : k_field_sizes_m)
      answers.emplace_back(size_m, field_answer_of(stretches, slow_m, size_m, prior));
  double most = answers.front().second.log_likelihood;
  for (const auto& [size_m, answer] : answers) most = std::max(most, answer.log_likelihood);
  double sum = 0;
  Eigen::Matrix3d out = Eigen::Matrix3d::Zero();
  for (const auto& [size_m, answer] : answers) {
    const double weight = std::exp(answer.log_likelihood - most) /
                          (size_m > 0 ? static_cast<double>(k_field_sizes_m.size() - 1) : 1.0);
    sum += weight;
    if (size_m < k_field_usual_m)
      out += weight * claimed_m2;
    else
      out += weight * (answer.covariance_m2 + answer.moved_m * answer.moved_m.transpose());
  }
  return out / sum;
}

}  // namespace

std::size_t add_direction_doubt(const FlightRows& flight, const FlightOptions& options, JointFit& fit) {
  std::size_t n_wider = 0;
  for (std::size_t i = 0; i < flight.anchors.size(); ++i) {
    if (!fit.state.anchors[i].active) continue;
    const std::vector<Stretch> few = stretches_of(flight, options, fit, i);
    if (few.size() < k_least_stretches) continue;
    const AnchorBlock& block = fit.normal.anchors[i];
    // Where neighbours are too far apart to show it, all of the scatter may be noise.
    const double white_share = block.white_share > 0 ? block.white_share : 1.0;
    Stretches stretches(few, std::max(white_share * block.scale_m * block.scale_m,
                                      options.min_scale_m * options.min_scale_m));
    const FieldInformation prior = field_prior(flight, options, fit, i);
    Eigen::Matrix4d& covariance_m2 = fit.anchor_covariance[i];
    const Eigen::Matrix4d before_m2 = covariance_m2;
    hold(field_held_m2(stretches, prior, before_m2.topLeftCorner<3, 3>()), options.dims, covariance_m2);
    n_wider += much_wider(covariance_m2, before_m2, options.dims) ? 1 : 0;
  }
  return n_wider;
}

}  // namespace anchord
