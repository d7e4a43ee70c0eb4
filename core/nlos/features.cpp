#include "core/nlos/features.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::nlos {
namespace {

// 5 % quantile of 20 log10(s / sqrt N) of the register in three public sets; of CIR noise taps it lies 10 dB
// higher.
constexpr double k_noise_floor_db = 7.4;
constexpr double k_cir_noise_floor_db = 17.4;

std::optional<double> positive(std::optional<double> value) {
  return value && *value > 0 && std::isfinite(*value) ? value : std::nullopt;
}

double db20(double ratio) { return 20 * std::log10(ratio); }

std::optional<double> difference(std::optional<double> a, std::optional<double> b) {
  if (!a || !b) return std::nullopt;
  return *a - *b;
}

void set_levels(const DiagnosticSample& s, FeatureVector& out, std::optional<double>& rx,
                std::optional<double>& fp) {
  const auto n = positive(s.preamble_count);
  const auto c = positive(s.cir_power);
  const bool amplitudes = s.fp_amp1 && s.fp_amp2 && s.fp_amp3;
  rx = c && n ? received_dbm(*c, *n, s.prf) : s.rx_dbm;
  fp = amplitudes && n ? first_path_dbm(*s.fp_amp1, *s.fp_amp2, *s.fp_amp3, *n, s.prf) : s.fp_dbm;
  std::optional<double> d = difference(rx, fp);
  if (c && amplitudes && !n) d = power_difference_db(*c, *s.fp_amp1, *s.fp_amp2, *s.fp_amp3);
  if (s.cir && n) {  // computed from the CIR where no register said it
    const double n2 = *n * *n;
    if (!rx && s.cir->energy > 0) rx = 10 * std::log10(s.cir->energy / n2) - power_constant_db(s.prf);
    if (!fp && s.cir->first_path_energy > 0)
      fp = 10 * std::log10(s.cir->first_path_energy / n2) - power_constant_db(s.prf);
    if (!d) d = difference(rx, fp);
  }
  out.set(Feature::rx_dbm, rx);
  out.set(Feature::fp_dbm, fp);
  out.set(Feature::rx_minus_fp_db, d);
}

void set_noise(const DiagnosticSample& s, std::optional<double> rx, std::optional<double> preamble_db,
               FeatureVector& out) {
  auto noise = positive(s.std_noise);
  double floor_db = k_noise_floor_db;
  if (!noise && s.cir) {
    noise = positive(s.cir->noise_rms);
    floor_db = k_cir_noise_floor_db;
  }
  if (!noise) return;
  const double noise_db = db20(*noise);
  if (preamble_db) out.set(Feature::noise_excess_db, noise_db - 0.5 * *preamble_db - floor_db);
  if (s.fp_amp1 && s.fp_amp2 && s.fp_amp3) {
    const double top = std::max({*s.fp_amp1, *s.fp_amp2, *s.fp_amp3});
    if (top > 0) out.set(Feature::fp_snr_db, db20(top) - noise_db);
  }
  if (rx && preamble_db)
    out.set(Feature::total_snr_db, *rx + power_constant_db(s.prf) + *preamble_db - noise_db);
  else if (const auto c = positive(s.cir_power))
    out.set(Feature::total_snr_db, 10 * std::log10(*c * 131072.0) - noise_db);
  if (const auto top = positive(s.max_noise)) out.set(Feature::max_noise_db, db20(*top) - noise_db);
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
    case Feature::fp_index:
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
  std::optional<double> rx, fp;
  set_levels(s, out, rx, fp);
  std::optional<double> preamble_db;
  if (const auto n = positive(s.preamble_count)) preamble_db = db20(*n);
  out.set(Feature::preamble_db, preamble_db);
  set_noise(s, rx, preamble_db, out);
  if (const auto range = positive(s.range_m)) {
    const double range_db = db20(*range);
    out.set(Feature::range_m, *range);
    out.set(Feature::range_db, range_db);
    if (rx) out.set(Feature::rx_free_space_db, *rx + range_db);
    if (fp) out.set(Feature::fp_free_space_db, *fp + range_db);
  }
  const auto f1 = positive(s.fp_amp1), f2 = positive(s.fp_amp2), f3 = positive(s.fp_amp3);
  if (f1 && f2) out.set(Feature::fp_shape12_db, db20(*f1 / *f2));
  if (f3 && f2) out.set(Feature::fp_shape32_db, db20(*f3 / *f2));
  out.set(Feature::fp_index, s.fp_index ? s.fp_index
                             : s.cir    ? std::optional{s.cir->first_path_idx}
                                        : std::nullopt);
  out.set(Feature::height_difference_m, s.height_difference_m);
  out.set(Feature::heading_deg, s.heading_deg);
  out.set(Feature::kurtosis, s.kurtosis);
  if (s.cir) {
    out.set(Feature::kurtosis, s.cir->kurtosis);
    out.set(Feature::mean_excess_delay_ns, s.cir->mean_excess_delay_ns);
    out.set(Feature::rms_delay_spread_ns, s.cir->rms_delay_spread_ns);
    out.set(Feature::early_energy, s.cir->early_energy);
    out.set(Feature::peak_delay_ns, s.cir->peak_delay_ns);
    if (const auto& whole = s.cir->whole) {
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
