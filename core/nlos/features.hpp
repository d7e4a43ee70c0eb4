#pragma once

#include <array>
#include <bitset>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"
#include "core/nlos/cir.hpp"
#include "core/nlos/power.hpp"

/// The one named, ordered, versioned feature set, from whatever a device, a recording or a public data set
/// gives.
namespace anchord::nlos {

/// Raised when a formula changes, so that a model is never fed numbers that mean something else. New names at
/// the end do not raise it.
inline constexpr std::string_view k_feature_set_version = "anchord-features-2";

/// The one before: its shapes of the impulse response were over 126 taps, of which a flight has 50.
/// Everything else is as it was.
inline constexpr std::string_view k_feature_set_before = "anchord-features-1";

enum class Feature : std::size_t {
  range_m,           ///< R as measured
  range_db,          ///< 20 log10 R
  rx_dbm,            ///< P_RX, eq 5.7
  fp_dbm,            ///< P_FP, eq 5.6
  rx_minus_fp_db,    ///< D = P_RX - P_FP
  noise_excess_db,   ///< E = 20 log10(s / sqrt N) - 7.4: a level meter that goes on where P_RX saturates
  fp_snr_db,         ///< S = 20 log10(max F / s)
  total_snr_db,      ///< T = 10 log10(C 2^17) - 20 log10 s
  preamble_db,       ///< L = 20 log10 N
  fp_shape12_db,     ///< 20 log10(F1 / F2)
  fp_shape32_db,     ///< 20 log10(F3 / F2)
  rx_free_space_db,  ///< X = P_RX + 20 log10 R
  fp_free_space_db,  ///< P_FP + 20 log10 R
  fp_index,          ///< first-path tap of the whole record
  max_noise_db,      ///< 20 log10(max noise / s)
  // Over the window of CirOptions, the taps -5 to +44 about the first path, less the noise:
  kurtosis,              ///< eq 5.3
  mean_excess_delay_ns,  ///< eq 5.4
  rms_delay_spread_ns,   ///< eq 5.5
  early_energy,          ///< share of the energy in the first 13 taps of the window
  peak_delay_ns,         ///< strongest tap after the first path
  height_difference_m,
  heading_deg,
  log_range_spread,        ///< ln(0.005 + sd R) over a window at rest
  log_fp_spread,           ///< ln(0.01 + (q90 - q10) / 2.56) of P_FP
  log_rx_minus_fp_spread,  ///< same of D
  kurtosis_whole,          ///< eq 5.3 to 5.5 over every tap of a whole record, as printed
  mean_excess_delay_whole_ns,
  rms_delay_spread_whole_ns,
};
inline constexpr auto k_feature_words =
    enum_table<Feature>({{"range_m", Feature::range_m},
                         {"range_db", Feature::range_db},
                         {"rx_dbm", Feature::rx_dbm},
                         {"fp_dbm", Feature::fp_dbm},
                         {"rx_minus_fp_db", Feature::rx_minus_fp_db},
                         {"noise_excess_db", Feature::noise_excess_db},
                         {"fp_snr_db", Feature::fp_snr_db},
                         {"total_snr_db", Feature::total_snr_db},
                         {"preamble_db", Feature::preamble_db},
                         {"fp_shape12_db", Feature::fp_shape12_db},
                         {"fp_shape32_db", Feature::fp_shape32_db},
                         {"rx_free_space_db", Feature::rx_free_space_db},
                         {"fp_free_space_db", Feature::fp_free_space_db},
                         {"fp_index", Feature::fp_index},
                         {"max_noise_db", Feature::max_noise_db},
                         {"kurtosis", Feature::kurtosis},
                         {"mean_excess_delay_ns", Feature::mean_excess_delay_ns},
                         {"rms_delay_spread_ns", Feature::rms_delay_spread_ns},
                         {"early_energy", Feature::early_energy},
                         {"peak_delay_ns", Feature::peak_delay_ns},
                         {"height_difference_m", Feature::height_difference_m},
                         {"heading_deg", Feature::heading_deg},
                         {"log_range_spread", Feature::log_range_spread},
                         {"log_fp_spread", Feature::log_fp_spread},
                         {"log_rx_minus_fp_spread", Feature::log_rx_minus_fp_spread},
                         {"kurtosis_whole", Feature::kurtosis_whole},
                         {"mean_excess_delay_whole_ns", Feature::mean_excess_delay_whole_ns},
                         {"rms_delay_spread_whole_ns", Feature::rms_delay_spread_whole_ns}});
inline constexpr std::size_t k_feature_count = k_feature_words.size();

/// The least a source must give for a feature to exist.
enum class Needs : std::uint8_t {
  range,      ///< a range of a flight: distance, levels, STD_NOISE
  impulse,    ///< a range of a flight with its CIR and preamble count
  record,     ///< the whole CIR, noise and all: a flight reads a window
  registers,  ///< what only campaigns and recordings keep: amplitudes, MAX_NOISE
  label,      ///< what a person noted of the place; a flight's heading is of another zero
  rest,       ///< repeats at rest: a mean or median of several rangings
};
Needs needs_of(Feature feature);

/// Whether some range of a flight can have it; a model that asks for another can never judge one.
bool live_ranges_have(Feature feature);

/// Whether features of that name mean the same in another version as here.
bool means_the_same(std::string_view version, std::string_view feature_name);

constexpr std::string_view feature_name(Feature feature) { return k_feature_words.word(feature); }
constexpr std::optional<Feature> feature_of(std::string_view name) { return k_feature_words.find(name); }

/// One ranging's diagnostics. Registers win over levels given in dBm: data sets differ in their constants.
struct DiagnosticSample {
  std::optional<double> range_m{};
  std::optional<double> rx_dbm{}, fp_dbm{};
  std::optional<double> fp_amp1{}, fp_amp2{}, fp_amp3{};
  std::optional<double> cir_power{};       ///< CIR_PWR register, C
  std::optional<double> preamble_count{};  ///< RXPACC, N
  std::optional<double> std_noise{}, max_noise{};
  std::optional<double> fp_index{};
  std::optional<double> height_difference_m{}, heading_deg{};
  std::optional<double> kurtosis{};  ///< where the source computed it; a CIR's own shape wins
  std::optional<CirShape> cir{};
  Prf prf{Prf::mhz64};
};

/// Values in the order of Feature; a value counts only where its bit is set.
struct FeatureVector {
  std::array<double, k_feature_count> values{};
  std::bitset<k_feature_count> present{};

  void set(Feature feature, std::optional<double> value) {
    if (!value || !std::isfinite(*value)) return;
    values[static_cast<std::size_t>(feature)] = *value;
    present.set(static_cast<std::size_t>(feature));
  }
  std::optional<double> get(Feature feature) const;
};

/// Everything the sample allows; non-finite and impossible inputs (range <= 0, no noise) leave their features
/// out. No allocation.
FeatureVector compute_features(const DiagnosticSample& sample);

/// Batch form: out[i] from samples[i]; out.size() must be at least samples.size().
void compute_features(std::span<const DiagnosticSample> samples, std::span<FeatureVector> out);

/// Median of each feature over repeats at one placement (features lacking in any repeat are lacking), and
/// with at least 3 repeats the three spreads.
FeatureVector aggregate_at_rest(std::span<const FeatureVector> repeats);

/// Sliding window over the ranges of one link at rest: sd of the last `capacity`. Zero ranges are faults and
/// are not taken (5.2).
class RangeSpread {
 public:
  explicit RangeSpread(std::size_t capacity = 10) : capacity_{capacity} {}
  void add(double range_m);
  void clear() { ranges_m_.clear(); }
  std::optional<double> sd_m() const;  ///< sample sd, from 3 ranges on

 private:
  std::size_t capacity_;
  std::vector<double> ranges_m_{};
};

}  // namespace anchord::nlos
