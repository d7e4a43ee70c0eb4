#include "core/nlos/cir.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>  // declares the built-in functions of wide registers
#endif

namespace anchord::nlos {
namespace {

/// PRF 16 MHz has 992 taps, 64 MHz 1016.
constexpr std::size_t k_whole_record = 992;

constexpr std::size_t k_lanes = 4;
/// Four doubles and the arithmetic of one: two SSE2 registers or one of AVX2, the same operations in either.
using Four = double __attribute__((vector_size(32)));
using FourFloats = float __attribute__((vector_size(16)));
using FourInts = std::int32_t __attribute__((vector_size(16)));
using FourWords = std::uint32_t __attribute__((vector_size(16)));
using EightWords = std::uint32_t __attribute__((vector_size(32)));
using EightShorts = std::int16_t __attribute__((vector_size(16)));
using SixteenShorts = std::int16_t __attribute__((vector_size(32)));
using FourLongs = std::uint64_t __attribute__((vector_size(32)));
#define ANCHORD_INLINE inline __attribute__((always_inline))

ANCHORD_INLINE Four four(double value) { return Four{value, value, value, value}; }
ANCHORD_INLINE double sum(Four a) { return (a[0] + a[1]) + (a[2] + a[3]); }
ANCHORD_INLINE Four absolute(Four a) {
  return reinterpret_cast<Four>(reinterpret_cast<FourLongs>(a) & 0x7fff'ffff'ffff'ffffU);
}

/// Group of four taps of which only `count` are asked for, the others 0; `left` of them are in memory.
template <class Group, class Number>
ANCHORD_INLINE Group first_of(const Number* from, std::size_t count, std::size_t left) {
  Group out{};
  if (left < k_lanes) {
    std::memcpy(&out, from, count * (sizeof out / k_lanes));
    return out;
  }
  std::memcpy(&out, from, sizeof out);
  if (count >= k_lanes) return out;
  const auto asked = FourWords{0, 1, 2, 3} < static_cast<std::uint32_t>(count);
  return reinterpret_cast<Group>(reinterpret_cast<FourInts>(out) & asked);
}

/// |h|^2 of four taps, re and im side by side. All of them fit 32 bits without a sign.
ANCHORD_INLINE FourWords squares(EightShorts re_im) {
#if defined(__x86_64__)
  return reinterpret_cast<FourWords>(__builtin_ia32_pmaddwd128(re_im, re_im));
#else
  // Which half of a word is which makes no odds: both are squared.
  const auto words = reinterpret_cast<FourInts>(re_im);
  const auto one = reinterpret_cast<FourWords>(words >> 16);
  const auto other = reinterpret_cast<FourWords>(words << 16 >> 16);
  return one * one + other * other;
#endif
}

template <bool wide>
struct Complex {
  const std::int16_t* re_im;
  std::size_t n;

  double power(std::size_t k) const {
    const double re = re_im[2 * k];
    const double im = re_im[2 * k + 1];
    return re * re + im * im;
  }
  /// Of the group of taps from k on, 0 from `count` on.
  ANCHORD_INLINE Four powers(std::size_t k, std::size_t count) const {
    const auto power =
        reinterpret_cast<FourInts>(squares(first_of<EightShorts>(re_im + 2 * k, count, n - k)));
    // 2^31, of twice -32768, is the one power that a signed word takes for a negative one.
    return absolute(__builtin_convertvector(power, Four));
  }
  ANCHORD_INLINE Four magnitudes(Four powers, std::size_t, std::size_t) const {
    Four out;
    for (std::size_t i = 0; i < k_lanes; ++i) out[i] = __builtin_sqrt(powers[i]);
    return out;
  }
  /// In integers: eight taps at a time, and exact.
  ANCHORD_INLINE double energy(std::size_t begin, std::size_t end) const {
    // Of pairs of words: the upper ones, and both together, from which the upper ones are taken out again.
    FourLongs both{}, both_too{}, upper{}, upper_too{};
    std::size_t k = begin;
    for (; k + 16 <= end; k += 16) {
      const FourLongs pairs = squares_of_eight(k), more = squares_of_eight(k + 8);
      both += pairs;
      both_too += more;
      upper += pairs >> 32U;
      upper_too += more >> 32U;
    }
    if (k + 8 <= end) {
      const FourLongs pairs = squares_of_eight(k);
      both += pairs;
      upper += pairs >> 32U;
      k += 8;
    }
    both += both_too;
    upper += upper_too;
    const FourLongs all = both - (upper << 32U) + upper;
    auto out = static_cast<double>((all[0] + all[1]) + (all[2] + all[3]));
    for (; k < end; ++k) out += power(k);
    return out;
  }

 private:
  ANCHORD_INLINE FourLongs squares_of_eight(std::size_t k) const {
#if defined(__x86_64__)
    if constexpr (wide) {
      SixteenShorts taps;
      std::memcpy(&taps, re_im + 2 * k, sizeof taps);
      return reinterpret_cast<FourLongs>(__builtin_ia32_pmaddwd256(taps, taps));
    }
#endif
    std::array<EightShorts, 2> taps;
    std::memcpy(&taps, re_im + 2 * k, sizeof taps);
    const std::array halves{squares(taps[0]), squares(taps[1])};
    FourLongs out;
    std::memcpy(&out, &halves, sizeof out);
    return out;
  }
};

struct Magnitude {
  const float* m;
  std::size_t n;

  double power(std::size_t k) const { return static_cast<double>(m[k]) * static_cast<double>(m[k]); }
  ANCHORD_INLINE Four magnitudes(Four, std::size_t k, std::size_t count) const {
    return absolute(__builtin_convertvector(first_of<FourFloats>(m + k, count, n - k), Four));
  }
  ANCHORD_INLINE Four powers(std::size_t k, std::size_t count) const {
    const Four magnitude = magnitudes(Four{}, k, count);
    return magnitude * magnitude;
  }
  ANCHORD_INLINE double energy(std::size_t begin, std::size_t end) const {
    Four out{};
    std::size_t k = begin;
    for (; k + k_lanes <= end; k += k_lanes) out += powers(k, k_lanes);
    return k < end ? sum(out + powers(k, end - k)) : sum(out);
  }
};

/// Raw moments of |h|: kurtosis is eq 5.3.
struct Moments {
  Four m1{}, m2{}, m3{}, m4{};
  ANCHORD_INLINE void add(Four power, Four magnitude) {
    m1 += magnitude;
    m2 += power;
    m3 += power * magnitude;
    m4 += power * power;
  }
  ANCHORD_INLINE double kurtosis(double count) const {
    const double mean2 = sum(m2) / count, mu = sum(m1) / count, var = mean2 - mu * mu;
    const double mu4 =
        sum(m4) / count - 4 * mu * sum(m3) / count + 6 * mu * mu * mean2 - 3 * mu * mu * mu * mu;
    return var > 1e-12 * mean2 ? mu4 / (var * var) : 0.0;
  }
};

/// Of a power q at taps t from the first path.
struct Delays {
  Four q{}, qt{}, qtt{};
  ANCHORD_INLINE void add(Four power, Four t) {
    const Four at = power * t;
    q += power;
    qt += at;
    qtt += at * t;
  }
  ANCHORD_INLINE double energy() const { return sum(q); }
  ANCHORD_INLINE double mean_taps() const { return sum(qt) / sum(q); }
  ANCHORD_INLINE double rms_taps() const {
    return std::sqrt(std::max(0.0, sum(qtt) / sum(q) - mean_taps() * mean_taps()));
  }
};

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

/// Every group of taps of a stretch; what is known of the length of a whole one makes it a single load.
template <class Taps, class Sums>
ANCHORD_INLINE void add_all(const Taps& taps, std::size_t begin, std::size_t end, Sums& sums) {
  std::size_t k = begin;
  Four tap = static_cast<double>(begin) + Four{0, 1, 2, 3};
  for (; k + k_lanes <= end; k += k_lanes, tap += 4.0) sums.add(taps, k, k_lanes, tap);
  if (k < end) sums.add(taps, k, end - k, tap);
}

struct Record {
  double first_path{};
  Moments moments{};
  Delays delays{};

  template <class Taps>
  ANCHORD_INLINE void add(const Taps& taps, std::size_t k, std::size_t count, Four tap) {
    const Four power = taps.powers(k, count);
    moments.add(power, taps.magnitudes(power, k, count));
    delays.add(power, tap - first_path);
  }
};

/// The taps of the window, q: power above the noise.
struct Window {
  double first_path{}, noise_power{}, keep_power{}, early_end{};
  Moments moments{};
  Delays above_noise{};
  Four early{};
  Four peak = four(-1), peak_tap{};

  template <class Taps>
  ANCHORD_INLINE void add(const Taps& taps, std::size_t k, std::size_t count, Four tap) {
    const Four power = taps.powers(k, count);
    moments.add(power, taps.magnitudes(power, k, count));
    const Four q = power > keep_power ? power - noise_power : four(0);
    above_noise.add(q, tap - first_path);
    early += tap < early_end ? q : four(0);
    peak_tap = power > peak ? tap : peak_tap;
    peak = power > peak ? power : peak;
  }
  /// The first of the strongest.
  ANCHORD_INLINE double strongest() const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < k_lanes; ++i)
      if (peak[i] > peak[best] || (peak[i] == peak[best] && peak_tap[i] < peak_tap[best])) best = i;
    return peak_tap[best];
  }
};

template <class Taps>
ANCHORD_INLINE std::optional<CirShape> shape_of(const Taps& taps, std::optional<double> first_path_idx,
                                                const CirOptions& o) {
  std::optional<CirShape> out;
  const std::size_t n = taps.n;
  const bool has_noise = n > o.noise_end && o.noise_end > o.noise_begin;
  const double noise_power =
      has_noise ? taps.energy(o.noise_begin, o.noise_end) / static_cast<double>(o.noise_end - o.noise_begin)
      : o.noise_rms ? *o.noise_rms * *o.noise_rms
                    : 0.0;
  if (!first_path_idx) {
    if (!has_noise) return out;
    first_path_idx =
        find_first_path(taps, n, o.noise_end, o.detect_rms * o.detect_rms * std::max(noise_power, 1e-9));
    if (!first_path_idx) return out;
  }
  const double fp = *first_path_idx;
  if (!(fp >= 0) || !(fp < static_cast<double>(n))) return out;
  const auto fp_tap = static_cast<std::size_t>(fp);
  if (fp_tap < o.window_before || fp_tap + o.window_after >= n) return out;
  const std::size_t begin = fp_tap - o.window_before, end = fp_tap + o.window_after + 1;

  Window window{fp, noise_power, o.keep_rms * o.keep_rms * noise_power,
                static_cast<double>(begin + o.early_taps)};
  add_all(taps, begin, end, window);
  const double above_noise = window.above_noise.energy();
  if (!(above_noise > 0)) return out;

  CirShape& shape = out.emplace();
  shape.first_path_idx = fp;
  shape.kurtosis = window.moments.kurtosis(static_cast<double>(end - begin));
  shape.mean_excess_delay_ns = window.above_noise.mean_taps() * o.tap_ns;
  shape.rms_delay_spread_ns = window.above_noise.rms_taps() * o.tap_ns;
  shape.early_energy = sum(window.early) / above_noise;
  shape.peak_delay_ns = (window.strongest() - fp) * o.tap_ns;
  shape.noise_rms = std::sqrt(noise_power);
  for (std::size_t k = fp_tap + 1; k <= fp_tap + 3 && k < n; ++k) shape.first_path_energy += taps.power(k);
  if (o.whole_record && has_noise && !(n < k_whole_record)) {
    Record record{fp};
    add_all(taps, 0, n, record);
    shape.whole = {record.moments.kurtosis(static_cast<double>(n)), record.delays.mean_taps() * o.tap_ns,
                   record.delays.rms_taps() * o.tap_ns};
  }
  const double all = sum(window.moments.m2) + taps.energy(end, n);
  shape.energy = std::max(0.0, all - noise_power * static_cast<double>(n - begin));
  return out;
}

// The same source for every machine: what differs is how wide the registers are.
template <class Taps>
std::optional<CirShape> in_any_registers(const Taps& taps, std::optional<double> first_path_idx,
                                         const CirOptions& o) {
  return shape_of(taps, first_path_idx, o);
}
#if defined(__x86_64__)
template <class Taps>
__attribute__((target("avx2"))) std::optional<CirShape> in_avx2(const Taps& taps,
                                                                std::optional<double> first_path_idx,
                                                                const CirOptions& o) {
  return shape_of(taps, first_path_idx, o);
}
const bool k_avx2 = __builtin_cpu_supports("avx2") != 0;
#else
constexpr bool k_avx2 = false;
template <class Taps>
std::optional<CirShape> in_avx2(const Taps& taps, std::optional<double> first_path_idx, const CirOptions& o) {
  return in_any_registers(taps, first_path_idx, o);
}
#endif

}  // namespace

std::optional<CirShape> cir_shape(std::span<const std::int16_t> re_im, std::optional<double> first_path_idx,
                                  const CirOptions& options) {
  const std::size_t n = re_im.size() / 2;
  if (k_avx2 && options.wide_registers)
    return in_avx2(Complex<true>{re_im.data(), n}, first_path_idx, options);
  return in_any_registers(Complex<false>{re_im.data(), n}, first_path_idx, options);
}

std::optional<CirShape> cir_shape(std::span<const float> magnitude, std::optional<double> first_path_idx,
                                  const CirOptions& options) {
  const Magnitude taps{magnitude.data(), magnitude.size()};
  if (k_avx2 && options.wide_registers) return in_avx2(taps, first_path_idx, options);
  return in_any_registers(taps, first_path_idx, options);
}

}  // namespace anchord::nlos
