#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "core/ml/train.hpp"

namespace anchord::ml {
namespace {

double quantile(std::vector<double> values, double q) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(std::lround(q * static_cast<double>(values.size() - 1)))];
}

// Nelder-Mead with the standard coefficients: the likelihood is smooth, has 5 to 7 parameters, and no
// derivative code to get wrong.
std::vector<double> minimise(const std::function<double(const std::vector<double>&)>& f,
                             std::vector<double> start, double step, int evaluations) {
  const std::size_t d = start.size();
  std::vector<std::pair<double, std::vector<double>>> simplex{{f(start), start}};
  for (std::size_t i = 0; i < d; ++i) {
    auto corner = start;
    corner[i] += step;
    simplex.emplace_back(f(corner), corner);
  }
  const auto by_value = [](const auto& a, const auto& b) { return a.first < b.first; };
  int used = static_cast<int>(d) + 1;
  while (used < evaluations) {
    std::stable_sort(simplex.begin(), simplex.end(), by_value);
    if (simplex.back().first - simplex.front().first < 1e-9) break;
    std::vector<double> centre(d, 0.0);
    for (std::size_t k = 0; k < d; ++k)
      for (std::size_t i = 0; i < d; ++i) centre[i] += simplex[k].second[i] / static_cast<double>(d);
    const auto at = [&](double t) {
      std::vector<double> p(d);
      for (std::size_t i = 0; i < d; ++i) p[i] = centre[i] + t * (simplex.back().second[i] - centre[i]);
      ++used;
      return std::pair{f(p), p};
    };
    const auto reflected = at(-1);
    if (reflected.first < simplex.front().first) {
      const auto expanded = at(-2);
      simplex.back() = expanded.first < reflected.first ? expanded : reflected;
    } else if (reflected.first < simplex[d - 1].first) {
      simplex.back() = reflected;
    } else {
      const auto contracted = at(reflected.first < simplex.back().first ? -0.5 : 0.5);
      if (contracted.first < std::min(reflected.first, simplex.back().first)) {
        simplex.back() = contracted;
      } else {
        for (std::size_t k = 1; k <= d; ++k) {
          for (std::size_t i = 0; i < d; ++i)
            simplex[k].second[i] = 0.5 * (simplex[k].second[i] + simplex[0].second[i]);
          simplex[k].first = f(simplex[k].second);
          ++used;
        }
      }
    }
  }
  std::stable_sort(simplex.begin(), simplex.end(), by_value);
  return simplex.front().second;
}

}  // namespace

Result<BiasMixture::Shared> fit_shared_bias(const MixtureTask& task) {
  std::vector<std::size_t> los_rows;
  std::vector<std::pair<double, double>> los_bias;
  for (std::size_t i = 0; i < task.bias_m.size(); ++i)
    if (task.los[i]) {
      los_rows.push_back(i);
      los_bias.emplace_back(task.bias_m[i], task.w[i]);
    }
  if (los_rows.size() < 8)
    return make_error(Errc::too_few_observations,
                      "the shared bias needs 8 LOS rows, got " + std::to_string(los_rows.size()));
  BiasMixture::Shared shared;
  shared.centre_m = weighted_median(std::move(los_bias));
  if (task.kappa == 0 || task.shared_features.empty()) return shared;
  shared.kappa = task.kappa;
  shared.features = task.shared_features;
  const std::size_t k = shared.features.size();
  std::vector<double> x(los_rows.size() * k), y, w;
  for (std::size_t j = 0; j < k; ++j) {
    std::vector<double> column;
    for (const auto i : los_rows) column.push_back(task.x[i * task.d + shared.features[j]]);
    shared.low.push_back(quantile(column, 0.01));
    shared.high.push_back(quantile(column, 0.99));
    for (std::size_t r = 0; r < los_rows.size(); ++r)
      x[r * k + j] = std::clamp(column[r], shared.low[j], shared.high[j]);
  }
  for (const auto i : los_rows) {
    y.push_back(task.bias_m[i]);
    w.push_back(task.w[i]);
  }
  const Scaler scaler = fit_scaler(x, k, w, 0);
  for (std::size_t r = 0; r < los_rows.size(); ++r)
    for (std::size_t j = 0; j < k; ++j) x[r * k + j] = (x[r * k + j] - scaler.mean[j]) / scaler.sd[j];
  const Linear g = fit_least_absolute({x, k, y, w}, 0.01);
  shared.mean = scaler.mean;
  shared.sd = scaler.sd;
  shared.weight = g.weights;
  shared.offset_m = g.offset;
  return shared;
}

Result<BiasMixture> fit_mixture(const MixtureTask& task) {
  BiasMixture m;
  BOOST_OUTCOME_TRY(m.shared, fit_shared_bias(task));
  const std::size_t n = task.bias_m.size();
  double total = 0;
  for (const double w : task.w) total += w;
  for (const auto f : task.tail_features) {
    std::vector<double> column(n);
    for (std::size_t i = 0; i < n; ++i) column[i] = task.x[i * task.d + f];
    const Scaler s = fit_scaler(column, 1, task.w, 0);
    m.tail.push_back({f, s.mean[0], s.sd[0], 0});
  }
  std::vector<double> shared(n);
  std::vector<std::pair<double, double>> los_spread, nlos_excess;
  for (std::size_t i = 0; i < n; ++i) {
    shared[i] = m.shared_m(task.x.subspan(i * task.d, task.d));
    const double e = task.bias_m[i] - shared[i];
    if (task.los[i])
      los_spread.emplace_back(std::abs(e), task.w[i]);
    else
      nlos_excess.emplace_back(std::max(e, 0.02), task.w[i]);
  }
  if (nlos_excess.size() < 8)
    return make_error(Errc::too_few_observations,
                      "the mixture needs 8 NLOS rows, got " + std::to_string(nlos_excess.size()));
  const double s0 = std::max(0.01, 1.4826 * weighted_median(los_spread));
  const double tau = std::max(0.03, weighted_median(nlos_excess) / 0.69);

  const auto unpack = [&m](const std::vector<double>& p) {
    m.m0_m = p[0];
    m.s0_m = std::exp(std::clamp(p[1], -5.0, 1.0));
    m.m1_m = p[2];
    m.s1_m = std::exp(std::clamp(p[3], -5.0, 1.0));
    m.log_tau = p[4];
    for (std::size_t t = 0; t < m.tail.size(); ++t) m.tail[t].weight = std::clamp(p[5 + t], -1.5, 1.5);
  };
  const auto loss = [&](const std::vector<double>& p) {
    unpack(p);
    double sum = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const BiasDensity density{task.p_los[i],
                                shared[i],
                                m.m0_m,
                                m.s0_m,
                                m.m1_m,
                                m.s1_m,
                                m.tau_m(task.x.subspan(i * task.d, task.d))};
      sum -= task.w[i] * density.log_density(task.bias_m[i]);
    }
    double penalty = 0;
    for (std::size_t t = 0; t < m.tail.size(); ++t) penalty += 0.02 * p[5 + t] * p[5 + t];
    for (const double v : {p[1], p[3]}) penalty += v < -5 || v > 1 ? 1.0 : 0.0;
    return sum / total + penalty;
  };
  std::vector<double> start{0, std::log(s0), 0, std::log(s0), std::log(tau)};
  start.resize(5 + m.tail.size(), 0.0);
  auto best = minimise(loss, start, 0.3, 400);
  best = minimise(loss, best, 0.1, 400);  // a fresh simplex: the first may have collapsed early
  unpack(best);
  const auto [least, most] = std::minmax_element(task.bias_m.begin(), task.bias_m.end());
  m.seen = BiasMixture::Seen{*least, *most};
  return m;
}

}  // namespace anchord::ml
