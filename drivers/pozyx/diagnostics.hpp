#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace anchord::pozyx {

/// What DW1000 registers would have said of a frame, from its impulse response alone: a stock tag's register
/// map has none of it. dw1000-diagnostics.md section 5; within a few tenths of a dB of the registers on
/// public records.
struct CirDiagnostics {
  double first_path_idx{};                   ///< tap of the accumulator, 10.6 fixed point in the register
  double f1{}, f2{}, f3{};                   ///< magnitudes at floor(first path) + 1, + 2, + 3
  double cir_power{};                        ///< C: sum |h|^2 less the noise, / 2^17
  double noise_sd{};                         ///< of |h| where no path is (STD_NOISE)
  double peak_idx{}, peak{};                 ///< strongest tap and its magnitude
  std::optional<double> fp_dbm{}, rx_dbm{};  ///< rx is the tag's own RSS, fp that less the power difference
  std::optional<double> preamble_count{};    ///< N that explains the RSS; +-6 % from its rounding
};

/// Taps read of one frame: `window` from `window_from` on, and `noise` from before any path. Interleaved
/// re, im. For a whole record window_from is 0 and `noise` empty: taps 50..649 serve.
struct CirTaps {
  std::span<const std::int16_t> window, noise;
  std::size_t window_from{};
};

/// No value without a first path above 6.4 rms of the noise, the median of the maker's own threshold.
/// rss_dbm  of the same exchange; absent: no levels in dBm
/// prf_constant_db  A of eq 5.6: 121.74 at PRF 64 MHz, 113.77 at 16
std::optional<CirDiagnostics> diagnose(const CirTaps& taps, std::optional<double> rss_dbm,
                                       double prf_constant_db);

}  // namespace anchord::pozyx
