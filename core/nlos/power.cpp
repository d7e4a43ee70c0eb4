#include "core/nlos/power.hpp"

namespace anchord::nlos {
namespace {
constexpr double k_two_17 = 131072.0;
}

double power_constant_db(Prf prf) { return prf == Prf::mhz16 ? 113.77 : 121.74; }

double corrected_preamble_count(double rxpacc, double rxpacc_nosat, Sfd sfd) {
  if (rxpacc != rxpacc_nosat) return rxpacc;
  switch (sfd) {
    case Sfd::standard_8:
      return rxpacc - 5;
    case Sfd::standard_64:
      return rxpacc - 64;
    case Sfd::decawave_8:
      return rxpacc - 10;
    case Sfd::decawave_16:
      return rxpacc - 18;
    case Sfd::decawave_64:
      return rxpacc - 82;
  }
  return rxpacc;
}

std::optional<double> first_path_dbm(double f1, double f2, double f3, double preamble_count, Prf prf) {
  const double energy = f1 * f1 + f2 * f2 + f3 * f3;
  if (!(energy > 0) || !(preamble_count > 0)) return std::nullopt;
  return decibels(energy / (preamble_count * preamble_count)) - power_constant_db(prf);
}

std::optional<double> received_dbm(double cir_power, double preamble_count, Prf prf) {
  if (!(cir_power > 0) || !(preamble_count > 0)) return std::nullopt;
  return decibels(cir_power * k_two_17 / (preamble_count * preamble_count)) - power_constant_db(prf);
}

std::optional<double> power_difference_db(double cir_power, double f1, double f2, double f3) {
  const double energy = f1 * f1 + f2 * f2 + f3 * f3;
  if (!(energy > 0) || !(cir_power > 0)) return std::nullopt;
  return decibels(cir_power * k_two_17 / energy);
}

double straightened_dbm(double level_dbm, Prf prf) {
  if (level_dbm <= -88) return level_dbm;
  return level_dbm + (level_dbm + 88) * (prf == Prf::mhz16 ? 2.3334 : 1.1667);
}

}  // namespace anchord::nlos
