#include "core/ml/model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/base/check.hpp"
#include "core/ml/sigmoid.hpp"

namespace anchord::ml {
namespace {

double dot(const double* a, const double* b, std::size_t n) {
  double sum = 0;
  for (std::size_t i = 0; i < n; ++i) sum += a[i] * b[i];
  return sum;
}

double raw(const Linear& m, std::span<const double> x) {
  return m.offset + dot(m.weights.data(), x.data(), m.weights.size());
}

double raw(const Polynomial& m, std::span<const double> x) {
  double sum = 0;
  for (const auto& term : m.terms) {
    double product = term.coefficient;
    for (const auto f : term.features) product *= x[f];
    sum += product;
  }
  return sum;
}

double raw(const Trees& m, std::span<const double> x) {
  double sum = 0;
  const auto* nodes = m.nodes.data();
  for (std::uint32_t at : m.roots) {
    while (nodes[at].feature >= 0)
      at = nodes[at].left + (x[static_cast<std::size_t>(nodes[at].feature)] < nodes[at].value ? 0U : 1U);
    sum += nodes[at].value;
  }
  return m.base + m.scale * sum;
}

double power(double base, int exponent) {
  double result = 1;
  for (int i = 0; i < exponent; ++i) result *= base;
  return result;
}

double raw(const Svm& m, std::span<const double> x) {
  double sum = -m.rho;
  for (std::size_t i = 0; i < m.alpha.size(); ++i) {
    const double* s = m.support.data() + i * m.dims;
    double k = 0;
    switch (m.kernel) {
      case Kernel::linear:
        k = dot(s, x.data(), m.dims);
        break;
      case Kernel::polynomial:
        k = power(m.gamma * dot(s, x.data(), m.dims) + m.coef0, m.degree);
        break;
      case Kernel::sigmoid:
        k = std::tanh(m.gamma * dot(s, x.data(), m.dims) + m.coef0);
        break;
      case Kernel::rbf: {
        double d2 = 0;
        for (std::size_t j = 0; j < m.dims; ++j) d2 += (s[j] - x[j]) * (s[j] - x[j]);
        k = std::exp(-m.gamma * d2);
        break;
      }
    }
    sum += m.alpha[i] * k;
  }
  return sum;
}

}  // namespace

void Scaler::apply(std::span<const double> in, std::span<double> out) const {
  for (std::size_t i = 0; i < mean.size(); ++i) {
    const double z = (in[i] - mean[i]) / sd[i];
    out[i] = clip > 0 ? std::clamp(z, -clip, clip) : z;
  }
}

double score(const Scorer& scorer, std::span<const double> x) {
  return std::visit([x](const auto& m) { return raw(m, x); }, scorer);
}

double Classifier::mean_logit(std::span<const double> features) const {
  ANCHORD_CHECK(scaler.mean.size() <= k_max_features && features.size() >= scaler.mean.size(),
                features.size() << " features given");
  std::array<double, k_max_features> z;
  scaler.apply(features, z);
  double sum = 0;
  for (const auto& member : members) {
    double s = score(member.scorer, {z.data(), scaler.mean.size()});
    if (member.share) {
      s = std::clamp(s, 0.01, 0.99);  // a forest of one opinion is not certainty
      s = std::log(s / (1 - s));
    }
    sum += member.slope * s + member.offset;
  }
  return members.empty() ? 0 : sum / static_cast<double>(members.size());
}

double Classifier::p_los(std::span<const double> features) const {
  return std::clamp(sigmoid(slope * mean_logit(features) + offset), p_min, p_max);
}

double Regressor::bias_m(std::span<const double> features) const {
  ANCHORD_CHECK(scaler.mean.size() <= k_max_features && features.size() >= scaler.mean.size(),
                features.size() << " features given");
  std::array<double, k_max_features> z;
  // A curve says nothing beyond the rows it was fitted to: 4 sd off, its answer counts half.
  double beyond_sd = 0;
  for (std::size_t i = 0; i < scaler.mean.size(); ++i)
    beyond_sd = std::max(beyond_sd, std::abs(features[i] - scaler.mean[i]) / scaler.sd[i] - 3.0);
  scaler.apply(features, z);
  const double answer = std::clamp(score(scorer, {z.data(), scaler.mean.size()}), min_m, max_m);
  return fallback_m + (answer - fallback_m) / (1 + beyond_sd * beyond_sd);
}

Prediction predict(const Model& model, std::span<const double> features) {
  Prediction out;
  if (model.classifier) {
    out.p_los = model.classifier->p_los(features);
    out.los = *out.p_los >= model.classifier->threshold;
  }
  if (model.mixture && out.p_los) {
    const auto density = density_of(*model.mixture, *out.p_los, features);
    out.bias_m = model.mixture->correction_m(density);
    out.sigma_m = density.sigma_m();
  } else if (model.regressor) {
    out.bias_m = model.regressor->bias_m(features);
    out.sigma_m = model.regressor->sigma_m;
  }
  return out;
}

std::optional<double> log_density(const Model& model, std::span<const double> features, double bias_m) {
  if (model.mixture && model.classifier)
    return density_of(*model.mixture, model.classifier->p_los(features), features).log_density(bias_m);
  if (!model.regressor) return std::nullopt;
  const double s = model.regressor->sigma_m;
  const double z = (bias_m - model.regressor->bias_m(features)) / s;
  return std::log(0.99 * std::exp(-0.5 * z * z) / (s * std::sqrt(2 * std::numbers::pi)) + 0.01 / 10);
}

}  // namespace anchord::ml
