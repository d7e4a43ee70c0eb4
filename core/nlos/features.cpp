#include "core/nlos/features.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace anchord::nlos {
namespace {

// 5 % quantile of 20 log10(s / sqrt N) of the register in three public sets; of CIR noise taps it lies 10 dB
// higher.
constexpr double k_noise_floor_db = 7.4;
constexpr double k_cir_noise_floor_db = 17.4;

/// No level: what it is taken from or added to is none either, and FeatureVector::set leaves it out. Optional
/// numbers handed on between functions are copied through memory, which was a fifth of all.
constexpr double k_unknown = std::numeric_limits<double>::quiet_NaN();
bool known(double level) { return !std::isnan(level); }

/// 0: not known.
double positive(const std::optional<double>& value) {
  return value && *value > 0 && std::isfinite(*value) ? *value : 0.0;
}

double db20(double ratio) { return 2 * decibels(ratio); }

void set(FeatureVector& out, Feature feature, const std::optional<double>& value) {
  if (value) out.set(feature, *value);
}

/// The registers of a sample, 0 where they are not known, and the levels that follow from them.
struct Levels {
  double preamble_count{}, cir_power{}, noise{};
  double rx_dbm{k_unknown}, fp_dbm{k_unknown}, preamble_db{k_unknown};
};

void set_levels(const DiagnosticSample& s, Levels& levels, FeatureVector& out) {
  const double n = levels.preamble_count = positive(s.preamble_count);
  const double c = levels.cir_power = positive(s.cir_power);
  const bool amplitudes = s.fp_amp1 && s.fp_amp2 && s.fp_amp3;
  double& rx = levels.rx_dbm;
  double& fp = levels.fp_dbm;
  rx = c > 0 && n > 0 ? received_dbm(c, n, s.prf).value_or(k_unknown) : s.rx_dbm.value_or(k_unknown);
  fp = amplitudes && n > 0 ? first_path_dbm(*s.fp_amp1, *s.fp_amp2, *s.fp_amp3, n, s.prf).value_or(k_unknown)
                           : s.fp_dbm.value_or(k_unknown);
  double d = rx - fp;
  if (c > 0 && amplitudes && !(n > 0))
    d = power_difference_db(c, *s.fp_amp1, *s.fp_amp2, *s.fp_amp3).value_or(k_unknown);
  if (s.cir && n > 0) {  // computed from the CIR where no register said it
    const double n2 = n * n;
    if (!known(rx) && s.cir->energy > 0) rx = decibels(s.cir->energy / n2) - power_constant_db(s.prf);
    if (!known(fp) && s.cir->first_path_energy > 0)
      fp = decibels(s.cir->first_path_energy / n2) - power_constant_db(s.prf);
    if (!known(d)) d = rx - fp;
  }
  if (n > 0) levels.preamble_db = db20(n);
  out.set(Feature::rx_dbm, rx);
  out.set(Feature::fp_dbm, fp);
  out.set(Feature::rx_minus_fp_db, d);
  out.set(Feature::preamble_db, levels.preamble_db);
}

void set_noise(const DiagnosticSample& s, const Levels& levels, FeatureVector& out) {
  double noise = positive(s.std_noise);
  double floor_db = k_noise_floor_db;
  if (!(noise > 0) && s.cir) {
    noise = std::isfinite(s.cir->noise_rms) ? s.cir->noise_rms : 0.0;
    floor_db = k_cir_noise_floor_db;
  }
  if (!(noise > 0)) return;
  const double noise_db = db20(noise);
  out.set(Feature::noise_excess_db, noise_db - 0.5 * levels.preamble_db - floor_db);
  if (s.fp_amp1 && s.fp_amp2 && s.fp_amp3) {
    const double top = std::max({*s.fp_amp1, *s.fp_amp2, *s.fp_amp3});
    if (top > 0) out.set(Feature::fp_snr_db, db20(top) - noise_db);
  }
  if (known(levels.rx_dbm) && known(levels.preamble_db))
    out.set(Feature::total_snr_db, levels.rx_dbm + power_constant_db(s.prf) + levels.preamble_db - noise_db);
  else if (levels.cir_power > 0)
    out.set(Feature::total_snr_db, decibels(levels.cir_power * 131072.0) - noise_db);
  if (const double top = positive(s.max_noise); top > 0) out.set(Feature::max_noise_db, db20(top) - noise_db);
}

double quantile(std::vector<double>& sorted, double q) {
  const double at = q * static_cast<double>(sorted.size() - 1);
  const auto low = static_cast<std::size_t>(at);
  const auto high = std::min(low + 1, sorted.size() - 1);
  return sorted[low] + (at - static_cast<double>(low)) * (sorted[high] - sorted[low]);
}

double sample_sd(std::span<const double> values) {
  double mean = 0;
  for (const double v : values) mean += v;
  mean /= static_cast<double>(values.size());
  double sum = 0;
  for (const double v : values) sum += (v - mean) * (v - mean);
  return std::sqrt(sum / static_cast<double>(values.size() - 1));
}

}  // namespace

bool means_the_same(std::string_view version, std::string_view name) {
  if (version == k_feature_set_version) return true;
  if (version != k_feature_set_before) return false;
  for (const auto windowed : {Feature::kurtosis, Feature::mean_excess_delay_ns, Feature::rms_delay_spread_ns,
                              Feature::early_energy, Feature::peak_delay_ns})
    if (feature_name(windowed) == name) return false;
  return true;
}

Needs needs_of(Feature feature) {
  switch (feature) {
    case Feature::range_m:
    case Feature::range_db:
    case Feature::rx_dbm:
    case Feature::fp_dbm:
    case Feature::rx_minus_fp_db:
    case Feature::rx_free_space_db:
    case Feature::fp_free_space_db:
      return Needs::range;
    case Feature::noise_excess_db:
    case Feature::total_snr_db:
    case Feature::preamble_db:
    case Feature::kurtosis:
    case Feature::mean_excess_delay_ns:
    case Feature::rms_delay_spread_ns:
    case Feature::early_energy:
    case Feature::peak_delay_ns:
      return Needs::impulse;
    case Feature::fp_snr_db:
    case Feature::fp_shape12_db:
    case Feature::fp_shape32_db:
    case Feature::max_noise_db:
      return Needs::registers;
    case Feature::fp_index:
    case Feature::kurtosis_whole:
    case Feature::mean_excess_delay_whole_ns:
    case Feature::rms_delay_spread_whole_ns:
      return Needs::record;
    case Feature::height_difference_m:
    case Feature::heading_deg:
      return Needs::label;
    case Feature::log_range_spread:
    case Feature::log_fp_spread:
    case Feature::log_rx_minus_fp_spread:
      return Needs::rest;
  }
  return Needs::label;
}

bool live_ranges_have(Feature feature) {
  const Needs needs = needs_of(feature);
  return needs == Needs::range || needs == Needs::impulse;
}

std::optional<double> FeatureVector::get(Feature feature) const {
  const auto at = static_cast<std::size_t>(feature);
  if (!present.test(at)) return std::nullopt;
  return values[at];
}

FeatureVector compute_features(const DiagnosticSample& s) {
  FeatureVector out;
  Levels levels;
  set_levels(s, levels, out);
  set_noise(s, levels, out);
  if (const double range_m = positive(s.range_m); range_m > 0) {
    const double range_db = db20(range_m);
    out.set(Feature::range_m, range_m);
    out.set(Feature::range_db, range_db);
    out.set(Feature::rx_free_space_db, levels.rx_dbm + range_db);
    out.set(Feature::fp_free_space_db, levels.fp_dbm + range_db);
  }
  if (const double f2 = positive(s.fp_amp2); f2 > 0) {
    if (const double f1 = positive(s.fp_amp1); f1 > 0) out.set(Feature::fp_shape12_db, db20(f1 / f2));
    if (const double f3 = positive(s.fp_amp3); f3 > 0) out.set(Feature::fp_shape32_db, db20(f3 / f2));
  }
  set(out, Feature::fp_index, s.fp_index);
  set(out, Feature::height_difference_m, s.height_difference_m);
  set(out, Feature::heading_deg, s.heading_deg);
  set(out, Feature::kurtosis, s.kurtosis);
  if (s.cir) {
    out.set(Feature::kurtosis, s.cir->kurtosis);
    out.set(Feature::mean_excess_delay_ns, s.cir->mean_excess_delay_ns);
    out.set(Feature::rms_delay_spread_ns, s.cir->rms_delay_spread_ns);
    out.set(Feature::early_energy, s.cir->early_energy);
    out.set(Feature::peak_delay_ns, s.cir->peak_delay_ns);
    if (const auto& whole = s.cir->whole) {
      if (!s.fp_index) out.set(Feature::fp_index, s.cir->first_path_idx);
      out.set(Feature::kurtosis_whole, whole->kurtosis);
      out.set(Feature::mean_excess_delay_whole_ns, whole->mean_excess_delay_ns);
      out.set(Feature::rms_delay_spread_whole_ns, whole->rms_delay_spread_ns);
    }
  }
  return out;
}

void compute_features(std::span<const DiagnosticSample> samples, std::span<FeatureVector> out) {
  for (std::size_t i = 0; i < samples.size(); ++i) out[i] = compute_features(samples[i]);
}

FeatureVector aggregate_at_rest(std::span<const FeatureVector> repeats) {
  FeatureVector out;
  if (repeats.empty()) return out;
  std::vector<double> column(repeats.size());
  for (std::size_t f = 0; f < k_feature_count; ++f) {
    if (!std::all_of(repeats.begin(), repeats.end(), [f](const auto& r) { return r.present.test(f); }))
      continue;
    for (std::size_t i = 0; i < repeats.size(); ++i) column[i] = repeats[i].values[f];
    const auto feature = static_cast<Feature>(f);
    if (repeats.size() >= 3 && feature == Feature::range_m)
      out.set(Feature::log_range_spread, std::log(0.005 + sample_sd(column)));
    std::sort(column.begin(), column.end());
    out.set(feature, quantile(column, 0.5));
    if (repeats.size() < 3 || (feature != Feature::fp_dbm && feature != Feature::rx_minus_fp_db)) continue;
    const double spread = (quantile(column, 0.9) - quantile(column, 0.1)) / 2.56;
    out.set(feature == Feature::fp_dbm ? Feature::log_fp_spread : Feature::log_rx_minus_fp_spread,
            std::log(0.01 + spread));
  }
  return out;
}

void RangeSpread::add(double range_m) {
  if (!(range_m > 0) || !std::isfinite(range_m)) return;
  if (ranges_m_.size() == capacity_) ranges_m_.erase(ranges_m_.begin());
  ranges_m_.push_back(range_m);
}

std::optional<double> RangeSpread::sd_m() const {
  if (ranges_m_.size() < 3) return std::nullopt;
  return sample_sd(ranges_m_);
}

}  // namespace anchord::nlos
