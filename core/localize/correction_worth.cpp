#include "core/localize/correction_worth.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include "core/localize/error_model_likelihood.hpp"

namespace anchord {
namespace {

constexpr double k_sure = 1.645;
constexpr std::size_t k_least_blocks = 8;
constexpr double k_degrees = 3;
constexpr double k_least_scale_m = 1e-3;

using Key = std::tuple<std::int64_t, NetworkId, std::uint8_t>;

/// Scale of Student's t by EM; the first guess is the mean size.
double t_scale(const std::vector<double>& errors_m) {
  double sum_m = 0;
  for (const double e : errors_m) sum_m += std::abs(e);
  double scale_m = std::max(sum_m / static_cast<double>(errors_m.size()), k_least_scale_m);
  for (int round = 0; round < 50; ++round) {
    double weighted = 0;
    for (const double e : errors_m)
      weighted += (k_degrees + 1) / (k_degrees + e * e / (scale_m * scale_m)) * e * e;
    scale_m = std::max(std::sqrt(weighted / static_cast<double>(errors_m.size())), k_least_scale_m);
  }
  return scale_m;
}

double ln_t(double error_m, double scale_m) {
  const double z2 = error_m * error_m / (scale_m * scale_m);
  // Gamma(2) / (Gamma(3/2) sqrt(3 pi)) = 2 / (pi sqrt 3)
  return std::log(2.0 / (std::numbers::pi * std::sqrt(k_degrees)) / scale_m) -
         0.5 * (k_degrees + 1) * std::log1p(z2 / k_degrees);
}

struct Both {
  double raw_m{}, corrected_m{};
  std::optional<RangeErrorModel> error_model{};
  std::int64_t t_ns{};
};

/// ln likelihood with minus without of each range of one anchor, by the block it is in.
void add_blocks(const std::vector<Both>& rows, double block_s, std::vector<double>& means, double& sum) {
  std::vector<double> raw_m, corrected_m;
  for (const Both& row : rows) {
    raw_m.push_back(row.raw_m);
    corrected_m.push_back(row.corrected_m);
  }
  const double raw_scale_m = t_scale(raw_m), corrected_scale_m = t_scale(corrected_m);
  std::map<std::int64_t, std::pair<double, std::size_t>> blocks;
  for (const Both& row : rows) {
    const double with =
        row.error_model ? std::log(error_model_value(*row.error_model, row.corrected_m, 0.0).density_per_m)
                        : ln_t(row.corrected_m, corrected_scale_m);
    const double gain = with - ln_t(row.raw_m, raw_scale_m);
    auto& [total, n] = blocks[std::llround(static_cast<double>(row.t_ns) * 1e-9 / block_s)];
    total += gain;
    ++n;
    sum += gain;
  }
  for (const auto& [at, block] : blocks) means.push_back(block.first / static_cast<double>(block.second));
}

}  // namespace

std::string CorrectionWorth::text() const {
  char text[200];
  std::snprintf(
      text, sizeof text,
      "%+.3f in ln likelihood per range with a sigma of %.3f over %zu ranges (at least %+.3f is required)",
      gain, sigma, n_ranges, k_sure * sigma);
  return text;
}

CorrectionWorth correction_worth(const FlightSolution& raw, const FlightSolution& corrected,
                                 const FlightData& corrected_flight, double block_s) {
  std::map<std::pair<NetworkId, Key>, RangeErrorModel> error_models;
  for (std::size_t i = 0; i < corrected_flight.error_models.size(); ++i) {
    const FlightRange range = corrected_flight.range(i);
    if (corrected_flight.error_models[i])
      error_models[{range.anchor, {range.time.ns, range.tag, range.antenna}}] =
          *corrected_flight.error_models[i];
  }
  const auto key = [](const RangeResidual& r) { return Key{r.time.ns, r.tag, r.antenna}; };
  CorrectionWorth worth;
  std::vector<double> means;
  double sum = 0;
  for (const auto& anchor : corrected.anchors) {
    const auto before = std::ranges::find(raw.anchors, anchor.estimate.anchor,
                                          [](const AnchorSolution& a) { return a.estimate.anchor; });
    if (before == raw.anchors.end()) continue;
    std::map<Key, double> raw_m;
    for (const auto& r : before->residuals) raw_m[key(r)] = r.residual_m;
    std::vector<Both> rows;
    for (const auto& r : anchor.residuals) {
      const auto at = raw_m.find(key(r));
      if (at == raw_m.end()) continue;
      Both both{at->second, r.residual_m, std::nullopt, r.time.ns};
      const auto error_model = error_models.find({anchor.estimate.anchor, key(r)});
      if (error_model != error_models.end()) both.error_model = error_model->second;
      rows.push_back(both);
    }
    if (rows.empty()) continue;
    worth.n_ranges += rows.size();
    add_blocks(rows, block_s, means, sum);
  }
  worth.n_blocks = means.size();
  if (worth.n_ranges == 0) return worth;
  worth.gain = sum / static_cast<double>(worth.n_ranges);
  double mean = 0, spread = 0;
  for (const double m : means) mean += m / static_cast<double>(means.size());
  for (const double m : means) spread += (m - mean) * (m - mean);
  const double n = static_cast<double>(means.size());
  worth.sigma = means.size() > 1 ? std::sqrt(spread / (n - 1) / n) : 0.0;
  worth.shown = means.size() >= k_least_blocks && worth.gain > k_sure * worth.sigma;
  return worth;
}

}  // namespace anchord
