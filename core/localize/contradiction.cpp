#include "core/localize/contradiction.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "core/localize/chi_square.hpp"

namespace anchord {
namespace {

constexpr double k_ungated_factor = 25;  // five times the distance
constexpr double k_exchange_gain = 25;

/// Squared distance in the metric of both covariances; not finite where one is singular.
double chi2_of(const KnownPlace& a, const KnownPlace& b, bool plane) {
  const Eigen::Vector3d apart = a.at_m - b.at_m;
  const Eigen::Matrix3d both = a.covariance_m2 + b.covariance_m2;
  if (plane) return apart.head<2>().dot(both.topLeftCorner<2, 2>().ldlt().solve(apart.head<2>()));
  return apart.dot(both.ldlt().solve(apart));
}

struct Swap {
  std::size_t a{}, b{};
  double chi2{}, chi2_exchanged{};
};

}  // namespace

std::vector<Contradiction> contradictions(std::span<const PlaceTwice> pairs, const GateLimits& limits) {
  std::vector<Contradiction> out;
  std::vector<const PlaceTwice*> of;
  for (const PlaceTwice& pair : pairs) {
    const double chi2 = chi2_of(pair.later, pair.published, pair.plane);
    const double limit = chi2_limit(pair.plane, limits) * (pair.acceptable ? 1.0 : k_ungated_factor);
    if (!std::isfinite(chi2) || chi2 <= limit) continue;
    out.push_back({pair.anchor, pair.later.at_m - pair.published.at_m, pair.plane, chi2, limit,
                   chi2_tail(chi2, pair.plane), std::nullopt});
    of.push_back(&pair);
  }
  std::vector<Swap> swaps;
  for (std::size_t a = 0; a < of.size(); ++a) {
    for (std::size_t b = a + 1; b < of.size(); ++b) {
      const bool plane = of[a]->plane || of[b]->plane;
      const double first = chi2_of(of[a]->later, of[b]->published, plane);
      const double second = chi2_of(of[b]->later, of[a]->published, plane);
      const double limit = chi2_limit(plane, limits);
      const Swap swap{a, b, out[a].chi2 + out[b].chi2, first + second};
      const bool fits = first <= limit && second <= limit;
      if (fits || swap.chi2_exchanged * k_exchange_gain <= swap.chi2) swaps.push_back(swap);
    }
  }
  std::ranges::sort(swaps, {}, [](const Swap& s) { return s.chi2_exchanged; });
  for (const Swap& swap : swaps) {
    if (out[swap.a].exchange || out[swap.b].exchange) continue;
    out[swap.a].exchange = {out[swap.b].anchor, swap.chi2, swap.chi2_exchanged};
    out[swap.b].exchange = {out[swap.a].anchor, swap.chi2, swap.chi2_exchanged};
  }
  return out;
}

}  // namespace anchord
