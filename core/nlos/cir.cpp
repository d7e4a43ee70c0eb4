#include "core/nlos/cir.hpp"

#include <algorithm>
#include <cmath>

namespace anchord::nlos {
namespace {

/// PRF 16 MHz has 992 taps, 64 MHz 1016.
constexpr std::size_t k_whole_record = 992;

struct Complex {
  const std::int16_t* re_im;
  double power(std::size_t k) const {
    const double re = re_im[2 * k];
    const double im = re_im[2 * k + 1];
    return re * re + im * im;
  }
};

struct Magnitude {
  const float* m;
  double power(std::size_t k) const { return static_cast<double>(m[k]) * static_cast<double>(m[k]); }
};

// Four independent sums, so that the additions do not wait for each other.
template <class Taps>
double mean_power(const Taps& taps, std::size_t begin, std::size_t end) {
  double s0 = 0, s1 = 0, s2 = 0, s3 = 0;
  std::size_t k = begin;
  for (; k + 4 <= end; k += 4) {
    s0 += taps.power(k);
    s1 += taps.power(k + 1);
    s2 += taps.power(k + 2);
    s3 += taps.power(k + 3);
  }
  for (; k < end; ++k) s0 += taps.power(k);
  return (s0 + s1 + s2 + s3) / static_cast<double>(end - begin);
}

// First tap above the threshold whose successor does not fall back under it, with the crossing interpolated.
template <class Taps>
std::optional<double> find_first_path(const Taps& taps, std::size_t n, std::size_t from,
                                      double threshold_power) {
  for (std::size_t k = from; k + 1 < n; ++k) {
    if (taps.power(k) < threshold_power || taps.power(k + 1) < threshold_power) continue;
    const double level = std::sqrt(threshold_power);
    const double here = std::sqrt(taps.power(k));
    const double before = k > 0 ? std::sqrt(taps.power(k - 1)) : 0.0;
    if (before >= level || here <= before) return static_cast<double>(k);
    return static_cast<double>(k) - 1 + (level - before) / (here - before);
  }
  return std::nullopt;
}

template <class Taps>
WholeRecordShape whole_shape(const Taps& taps, std::size_t n, double first_path, double tap_ns) {
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0, sum_t = 0, sum_tt = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const double power = taps.power(k), h = std::sqrt(power), t = static_cast<double>(k) - first_path;
    m1 += h;
    m2 += power;
    m3 += power * h;
    m4 += power * power;
    sum_t += power * t;
    sum_tt += power * t * t;
  }
  const auto count = static_cast<double>(n);
  const double mu = m1 / count, var = m2 / count - mu * mu;
  const double mu4 = m4 / count - 4 * mu * m3 / count + 6 * mu * mu * m2 / count - 3 * mu * mu * mu * mu;
  const double mean_tap = sum_t / m2;
  return {var > 1e-12 * (m2 / count) ? mu4 / (var * var) : 0.0, mean_tap * tap_ns,
          std::sqrt(std::max(0.0, sum_tt / m2 - mean_tap * mean_tap)) * tap_ns};
}

template <class Taps>
std::optional<CirShape> shape_of(const Taps& taps, std::size_t n, std::optional<double> first_path_idx,
                                 const CirOptions& o) {
  const bool has_noise = n > o.noise_end && o.noise_end > o.noise_begin;
  const double noise_power = has_noise     ? mean_power(taps, o.noise_begin, o.noise_end)
                             : o.noise_rms ? *o.noise_rms * *o.noise_rms
                                           : 0.0;
  if (!first_path_idx) {
    if (!has_noise) return std::nullopt;
    first_path_idx =
        find_first_path(taps, n, o.noise_end, o.detect_rms * o.detect_rms * std::max(noise_power, 1e-9));
    if (!first_path_idx) return std::nullopt;
  }
  const double fp = *first_path_idx;
  if (!(fp >= 0) || !(fp < static_cast<double>(n))) return std::nullopt;
  const auto fp_tap = static_cast<std::size_t>(fp);
  if (fp_tap < o.window_before || fp_tap + o.window_after >= n) return std::nullopt;
  const std::size_t begin = fp_tap - o.window_before, end = fp_tap + o.window_after + 1;

  double sum_q = 0, sum_qt = 0, sum_qtt = 0,
         early = 0;                       // q: power above the noise, t: taps from the first path
  double m1 = 0, m2 = 0, m3 = 0, m4 = 0;  // raw moments of |h|
  double peak = -1, peak_tap = 0, all = 0;
  const double keep_power = o.keep_rms * o.keep_rms * noise_power;
  for (std::size_t k = begin; k < end; ++k) {
    const double power = taps.power(k);
    const double h = std::sqrt(power);
    m1 += h;
    m2 += power;
    m3 += power * h;
    m4 += power * power;
    all += power;
    if (power > peak) {
      peak = power;
      peak_tap = static_cast<double>(k);
    }
    const double q = power > keep_power ? power - noise_power : 0.0;
    const double t = static_cast<double>(k) - fp;
    sum_q += q;
    sum_qt += q * t;
    sum_qtt += q * t * t;
    if (k < begin + o.early_taps) early += q;
  }
  if (!(sum_q > 0)) return std::nullopt;

  const auto count = static_cast<double>(end - begin);
  const double mu = m1 / count;
  const double var = m2 / count - mu * mu;
  const double mu4 = m4 / count - 4 * mu * m3 / count + 6 * mu * mu * m2 / count - 3 * mu * mu * mu * mu;
  CirShape shape;
  shape.first_path_idx = fp;
  shape.kurtosis = var > 1e-12 * (m2 / count) ? mu4 / (var * var) : 0.0;
  const double mean_tap = sum_qt / sum_q;
  shape.mean_excess_delay_ns = mean_tap * o.tap_ns;
  shape.rms_delay_spread_ns = std::sqrt(std::max(0.0, sum_qtt / sum_q - mean_tap * mean_tap)) * o.tap_ns;
  shape.early_energy = early / sum_q;
  shape.peak_delay_ns = (peak_tap - fp) * o.tap_ns;
  shape.noise_rms = std::sqrt(noise_power);
  for (std::size_t k = fp_tap + 1; k <= fp_tap + 3 && k < n; ++k) shape.first_path_energy += taps.power(k);
  for (std::size_t k = end; k < n; ++k) all += taps.power(k);
  if (has_noise && !(n < k_whole_record)) shape.whole = whole_shape(taps, n, fp, o.tap_ns);
  shape.energy = std::max(0.0, all - noise_power * static_cast<double>(n - begin));
  return shape;
}

}  // namespace

std::optional<CirShape> cir_shape(std::span<const std::int16_t> re_im, std::optional<double> first_path_idx,
                                  const CirOptions& options) {
  return shape_of(Complex{re_im.data()}, re_im.size() / 2, first_path_idx, options);
}

std::optional<CirShape> cir_shape(std::span<const float> magnitude, std::optional<double> first_path_idx,
                                  const CirOptions& options) {
  return shape_of(Magnitude{magnitude.data()}, magnitude.size(), first_path_idx, options);
}

}  // namespace anchord::nlos
