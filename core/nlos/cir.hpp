#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

/// Shape of a channel impulse response h(k), k = tap number.
namespace anchord::nlos {

struct CirOptions {
  double tap_ns = 1.001602564;   ///< 64 ticks of the DW1000 (1 / (128 x 499.2 MHz))
  std::size_t noise_begin = 50;  ///< taps before any path: DW1000 records have the first path at 705..856
  std::size_t noise_end = 650;
  std::size_t window_before =
      5;  ///< taps kept before the first path; over all 1016 taps the delays would measure noise
  /// Taps kept after it: what a tag's window of 128 taps from 672 on holds of 99 % of public records (first
  /// path at 752 at most). A longer one would be another feature in flight than in training.
  std::size_t window_after = 44;
  std::size_t early_taps = 13;  ///< of the window: first path and its pulse
  double detect_rms =
      6.4;  ///< first path: first tap above this many rms of the noise (median of the maker's own threshold)
  std::optional<double> noise_rms{};  ///< of a record without such taps, where its source knows it
  bool whole_record = true;           ///< whether WholeRecordShape is wanted: six sevenths of the work
  bool wide_registers = true;         ///< where the machine has them: the answer is the same to the last bit
  double keep_rms = 3.0;  ///< delays count only taps above this many rms of the noise, less the noise power
};

/// Over every tap of a whole record, noise and all, as eq 5.3 to 5.5 are printed: what the thresholds
/// of 5.3.3 are for.
struct WholeRecordShape {
  double kurtosis{}, mean_excess_delay_ns{}, rms_delay_spread_ns{};
};

/// What one pass over the taps gives.
struct CirShape {
  double first_path_idx{};        ///< given, or found by the threshold crossing
  double kurtosis{};              ///< of |h| over the window: mu4 / sigma^4 (eq 5.3; 3 for a Gaussian)
  double mean_excess_delay_ns{};  ///< eq 5.4, from the first path
  double rms_delay_spread_ns{};   ///< eq 5.5
  double early_energy{};          ///< share of the window's energy in its first early_taps, 0..1
  double peak_delay_ns{};         ///< strongest tap of the window after the first path
  double noise_rms{};             ///< sqrt(mean |h|^2) before any path, 0 where the record has no such taps
  double first_path_energy{};     ///< F1^2 + F2^2 + F3^2 at floor(first path) + 1, + 2, + 3
  std::optional<WholeRecordShape> whole{};  ///< absent where only a window was read
  double energy{};  ///< sum |h|^2 from the window on, less the noise: the register's C 2^17
};

/// No allocation. A record shorter than noise_end (a window read of it) has no noise taps: the first path
/// must be given, and its noise is that of the options, or none. No value where no first path is found, the
/// record does not hold the whole window round it, or nothing rises above the noise. taps  interleaved re, im
/// (2 n values), or magnitudes (n values)
std::optional<CirShape> cir_shape(std::span<const std::int16_t> re_im, std::optional<double> first_path_idx,
                                  const CirOptions& options = {});
std::optional<CirShape> cir_shape(std::span<const float> magnitude, std::optional<double> first_path_idx,
                                  const CirOptions& options = {});

}  // namespace anchord::nlos
