#include "core/ml/plausible.hpp"

#include <cmath>

namespace anchord::ml {
namespace {

bool of_one_unit(double range_m, double bias_m) {
  if (std::abs(bias_m) <= k_always_plausible_m) return true;
  const double true_m = range_m - bias_m;
  return true_m > 0 && range_m <= k_most_factor * true_m && true_m <= k_most_factor * range_m;
}

}  // namespace

bool plausible_range(double range_m, double bias_m) {
  return range_m <= k_reach_m && std::abs(bias_m) <= k_most_bias_m && of_one_unit(range_m, bias_m);
}

bool plausible_correction(double range_m, double bias_m) {
  return std::abs(bias_m) <= k_most_correction_m && of_one_unit(range_m, bias_m);
}

std::string_view why_withheld(Withheld why) {
  switch (why) {
    case Withheld::no:
      return {};
    case Withheld::far_features:
      return "the range is nothing like the ranges the model was trained on";
    case Withheld::unseen_bias:
      return "it is larger than every bias the model was trained on";
    case Withheld::implausible:
      return "no radio errs by that much: more than 10 m, or than half of the range";
  }
  return {};
}

}  // namespace anchord::ml
