#include "core/ml/metrics.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::ml {
namespace {
double ratio(double part, double whole) { return whole > 0 ? part / whole : 0; }
}  // namespace

void Confusion::count(bool is_los, bool called_los, double weight) {
  (is_los ? (called_los ? tp : fn) : (called_los ? fp : tn)) += weight;
}
double Confusion::accuracy() const { return ratio(tp + tn, total()); }
double Confusion::fpr() const { return ratio(fp, fp + tn); }
double Confusion::fnr() const { return ratio(fn, fn + tp); }
double Confusion::balanced_accuracy() const {
  if (tp + fn <= 0) return 1 - fpr();
  if (fp + tn <= 0) return 1 - fnr();
  return 1 - 0.5 * (fpr() + fnr());
}

Confusion confusion_at(std::span<const double> p_los, std::span<const std::uint8_t> los, double threshold) {
  Confusion c;
  for (std::size_t i = 0; i < p_los.size(); ++i) c.count(los[i] != 0, p_los[i] >= threshold);
  return c;
}

double brier(std::span<const double> p_los, std::span<const std::uint8_t> los,
             std::span<const double> weight) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < p_los.size(); ++i) {
    const double w = weight.empty() ? 1 : weight[i];
    const double d = p_los[i] - los[i];
    sum += w * d * d;
    total += w;
  }
  return ratio(sum, total);
}

double log_loss(std::span<const double> p_los, std::span<const std::uint8_t> los,
                std::span<const double> weight) {
  double sum = 0, total = 0;
  for (std::size_t i = 0; i < p_los.size(); ++i) {
    const double w = weight.empty() ? 1 : weight[i];
    const double p = std::clamp(p_los[i], 1e-6, 1 - 1e-6);
    sum -= w * std::log(los[i] ? p : 1 - p);
    total += w;
  }
  return ratio(sum, total);
}

std::vector<RocPoint> roc(std::span<const double> p_los, std::span<const std::uint8_t> los) {
  std::vector<std::size_t> order(p_los.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](auto a, auto b) { return p_los[a] > p_los[b]; });
  double positives = 0, negatives = 0;
  for (const auto y : los) (y ? positives : negatives) += 1;
  std::vector<RocPoint> curve{{1.0, 0, 0}};
  double tp = 0, fp = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    (los[order[i]] ? tp : fp) += 1;
    if (i + 1 < order.size() && p_los[order[i]] == p_los[order[i + 1]]) continue;
    curve.push_back({p_los[order[i]], ratio(fp, negatives), ratio(tp, positives)});
  }
  return curve;
}

double area_under(std::span<const RocPoint> curve) {
  double area = 0;
  for (std::size_t i = 1; i < curve.size(); ++i)
    area += 0.5 * (curve[i].fpr - curve[i - 1].fpr) * (curve[i].tpr + curve[i - 1].tpr);
  return area;
}

ErrorStats error_stats(std::span<const double> error_m) {
  ErrorStats stats;
  stats.n = error_m.size();
  if (error_m.empty()) return stats;
  for (const double e : error_m) {
    stats.mae_m += std::abs(e);
    stats.mse_m2 += e * e;
  }
  stats.mae_m /= static_cast<double>(stats.n);
  stats.mse_m2 /= static_cast<double>(stats.n);
  return stats;
}

double improvement(double uncorrected, double corrected) {
  return uncorrected > 0 ? (uncorrected - corrected) / uncorrected : 0;
}

std::vector<CdfPoint> cdf_of_magnitude(std::span<const double> value_m, std::size_t points) {
  std::vector<double> sorted;
  for (const double v : value_m) sorted.push_back(std::abs(v));
  std::sort(sorted.begin(), sorted.end());
  std::vector<CdfPoint> curve;
  if (sorted.empty() || points < 2) return curve;
  for (std::size_t i = 0; i < points; ++i) {
    const double share = static_cast<double>(i) / static_cast<double>(points - 1);
    const auto at = static_cast<std::size_t>(std::lround(share * static_cast<double>(sorted.size() - 1)));
    curve.push_back({sorted[at], share});
  }
  return curve;
}

}  // namespace anchord::ml
