#include "api/formats/rule_samples.hpp"

#include <cmath>
#include <map>

namespace anchord::api {
namespace {

// Sample sd of the ranges of each placement with at least 3 of them.
std::map<std::uint32_t, double> spread_of_placements(const LabelledTable& table) {
  struct Sums {
    double n{}, mean{}, squares{};  // Welford
  };
  std::map<std::uint32_t, Sums> sums;
  for (std::size_t i = 0; i < table.rows(); ++i) {
    auto& s = sums[table.placement[i]];
    s.n += 1;
    const double off = table.range_m[i] - s.mean;
    s.mean += off / s.n;
    s.squares += off * (table.range_m[i] - s.mean);
  }
  std::map<std::uint32_t, double> out;
  for (const auto& [id, s] : sums)
    if (s.n >= 3) out[id] = std::sqrt(s.squares / (s.n - 1));
  return out;
}

}  // namespace

std::vector<nlos::RuleSample> rule_samples(const LabelledTable& table) {
  std::vector<nlos::RuleSample> out;
  if (!table.labelled()) return out;
  using nlos::Feature;
  const auto spread = spread_of_placements(table);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const auto& f = table.features[i];
    nlos::RuleSample s;
    s.los = table.los[i].value_or(false);
    s.distance_m = table.true_range_m[i];
    if (!s.distance_m && table.range_m[i] > 0) s.distance_m = table.range_m[i];
    s.rss_dbm = f.get(Feature::rx_dbm);
    s.kurtosis = f.get(Feature::kurtosis);
    s.mean_excess_delay_ns = f.get(Feature::mean_excess_delay_ns);
    s.rms_delay_spread_ns = f.get(Feature::rms_delay_spread_whole_ns);
    s.rx_minus_fp_db = f.get(Feature::rx_minus_fp_db);
    if (const auto found = spread.find(table.placement[i]); found != spread.end())
      s.range_sd_m = found->second;
    out.push_back(s);
  }
  return out;
}

}  // namespace anchord::api
