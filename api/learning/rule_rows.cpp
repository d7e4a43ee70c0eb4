#include "api/learning/rule_rows.hpp"

#include <cmath>
#include <map>

#include "core/ml/dataset.hpp"

namespace anchord::api {
namespace {

using nlos::Feature;

/// Welford's sums of the ranges of one setting.
struct Spread {
  double n{}, mean{}, squares{};
  void add(double range_m) {
    n += 1;
    const double off = range_m - mean;
    mean += off / n;
    squares += off * (range_m - mean);
  }
  std::optional<double> sd_m() const {
    if (n < 3) return std::nullopt;
    return std::sqrt(squares / (n - 1));
  }
};

std::string setting_of(const DatasetRow& row) { return row.campaign + "\n" + row.setting; }

}  // namespace

Result<RuleReport> rules_of(const DatasetTable& table, std::string name, Place group_by, std::uint64_t seed) {
  RuleReport out;
  out.data_set = std::move(name);
  std::map<std::string, Spread> spreads;
  for (const auto& row : table.rows) spreads[setting_of(row)].add(row.range_m());
  std::vector<nlos::RuleSample> samples;
  std::map<std::string, std::uint32_t> places;
  std::vector<std::uint32_t> place;
  for (const auto& row : table.rows) {
    if (!row.los) continue;
    const auto& f = row.features;
    nlos::RuleSample s;
    s.los = *row.los;
    s.distance_m = row.true_range_m ? row.true_range_m : std::optional{row.range_m()};
    s.rss_dbm = f.get(Feature::rx_dbm);
    s.kurtosis = f.get(Feature::kurtosis);
    s.mean_excess_delay_ns = f.get(Feature::mean_excess_delay_ns);
    s.rms_delay_spread_ns = f.get(Feature::rms_delay_spread_whole_ns);
    s.rx_minus_fp_db = f.get(Feature::rx_minus_fp_db);
    s.range_sd_m = spreads.at(setting_of(row)).sd_m();
    if (const auto spread = f.get(Feature::log_range_spread)) s.range_sd_m = std::exp(*spread) - 0.005;
    (s.los ? out.los_rows : out.nlos_rows) += 1;
    samples.push_back(s);
    place.push_back(places.try_emplace(place_name(row, group_by), static_cast<std::uint32_t>(places.size()))
                        .first->second);
  }
  if (samples.empty()) return make_error(Errc::too_few_observations, "no row of the data set has a label");
  out.printed = nlos::evaluate_rules(nlos::printed_rules(), samples);
  out.fitted = nlos::evaluate_fitted_rules(samples, ml::grouped_folds(place, 10, seed));
  out.rules = nlos::fit_rules(samples);
  return out;
}

}  // namespace anchord::api
