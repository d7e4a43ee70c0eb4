#include "drivers/pozyx/diagnostics.hpp"

#include <cmath>

namespace anchord::pozyx {
namespace {

double power(std::span<const std::int16_t> re_im, std::size_t k) {
  const double re = re_im[2 * k], im = re_im[2 * k + 1];
  return re * re + im * im;
}

struct Noise {
  double mean_power{}, sd{};
};
std::optional<Noise> noise_of(std::span<const std::int16_t> re_im, std::size_t from, std::size_t to) {
  to = std::min(to, re_im.size() / 2);
  if (from + 8 > to) return std::nullopt;
  double sum = 0, sum_sqrt = 0;
  for (std::size_t k = from; k < to; ++k) {
    sum += power(re_im, k);
    sum_sqrt += std::sqrt(power(re_im, k));
  }
  const auto n = static_cast<double>(to - from);
  const double mean = sum_sqrt / n;
  return Noise{sum / n, std::sqrt(std::max(0.0, sum / n - mean * mean))};
}

}  // namespace

std::optional<CirDiagnostics> diagnose(const CirTaps& taps, std::optional<double> rss_dbm,
                                       double prf_constant_db) {
  constexpr double k_detect_rms = 6.4;
  constexpr std::size_t k_search_from = 650;  // no public record has its first path before 704
  const std::size_t n = taps.window.size() / 2;
  const auto noise = taps.noise.empty() ? noise_of(taps.window, 50, k_search_from)
                                        : noise_of(taps.noise, 0, taps.noise.size() / 2);
  if (!noise) return std::nullopt;
  const double threshold = k_detect_rms * k_detect_rms * std::max(noise->mean_power, 1.0);
  const std::size_t begin = taps.window_from < k_search_from ? k_search_from - taps.window_from : 0;
  std::size_t first = begin;
  // One tap above the threshold may be noise; the pulse is two to three taps wide.
  while (first + 1 < n &&
         !(power(taps.window, first) > threshold && power(taps.window, first + 1) > threshold))
    ++first;
  if (first + 4 >= n) return std::nullopt;

  CirDiagnostics out;
  double index = static_cast<double>(first);
  if (first > 0) {
    const double level = std::sqrt(threshold), here = std::sqrt(power(taps.window, first)),
                 before = std::sqrt(power(taps.window, first - 1));
    if (before < level && here > before) index -= (here - level) / (here - before);
  }
  const auto tap = static_cast<std::size_t>(index);
  out.f1 = std::sqrt(power(taps.window, tap + 1));
  out.f2 = std::sqrt(power(taps.window, tap + 2));
  out.f3 = std::sqrt(power(taps.window, tap + 3));
  out.first_path_idx = index + static_cast<double>(taps.window_from);
  out.noise_sd = noise->sd;
  double energy = 0;
  for (std::size_t k = tap; k < n; ++k) {
    const double p = power(taps.window, k);
    energy += p - noise->mean_power;
    if (p > out.peak * out.peak) {
      out.peak = std::sqrt(p);
      out.peak_idx = static_cast<double>(k + taps.window_from);
    }
  }
  const double first_energy = out.f1 * out.f1 + out.f2 * out.f2 + out.f3 * out.f3;
  if (!(energy > 0) || !(first_energy > 0)) return std::nullopt;
  out.cir_power = energy / 131072.0;
  if (rss_dbm) {
    out.rx_dbm = rss_dbm;
    out.fp_dbm = *rss_dbm - 10 * std::log10(energy / first_energy);
    out.preamble_count = std::sqrt(energy / std::pow(10.0, (*rss_dbm + prf_constant_db) / 10.0));
  }
  return out;
}

}  // namespace anchord::pozyx
