#pragma once

#include <cmath>
#include <numbers>
#include <optional>

/// Levels from the DW1000's receive diagnostics. Source: DW1000 User Manual 4.7; eq 5.6, 5.7 of the
/// dissertation.
namespace anchord::nlos {

/// Pulse repetition frequency: sets the constant A of eq 5.6 and 5.7.
enum class Prf { mhz16, mhz64 };

/// 10 log10 of a ratio of powers, by the natural logarithm: its library function takes half the time.
inline double decibels(double ratio) { return 10 / std::numbers::ln10 * std::log(ratio); }

/// A, dB: 113.77 at 16 MHz, 121.74 at 64 MHz (DW1000 User Manual 4.7.1).
double power_constant_db(Prf prf);

/// Start-of-frame delimiters, whose symbols the preamble counter also counted.
enum class Sfd { standard_8, standard_64, decawave_8, decawave_16, decawave_64 };

/// RXPACC without the SFD's symbols. The counter ran over the SFD only when RXPACC == RXPACC_NOSAT; else it
/// is used as it is.
double corrected_preamble_count(double rxpacc, double rxpacc_nosat, Sfd sfd);

/// P_FP = 10 log10((F1^2 + F2^2 + F3^2) / N^2) - A, dBm (eq 5.6). No value where N or all amplitudes are
/// zero.
std::optional<double> first_path_dbm(double f1, double f2, double f3, double preamble_count,
                                     Prf prf = Prf::mhz64);

/// P_RX = 10 log10(C 2^17 / N^2) - A, dBm (eq 5.7). No value where N or C is zero.
std::optional<double> received_dbm(double cir_power, double preamble_count, Prf prf = Prf::mhz64);

/// P_RX - P_FP, dB, straight from the registers: neither N nor A is in it.
std::optional<double> power_difference_db(double cir_power, double f1, double f2, double f3);

/// Straightens a level above -88 dBm, where the estimate saturates: P += (P + 88) k, k = 1.1667 (64 MHz)
/// or 2.3334 (16 MHz). Never mix straightened and plain levels in one feature; the feature set uses plain
/// ones.
double straightened_dbm(double level_dbm, Prf prf);

}  // namespace anchord::nlos
