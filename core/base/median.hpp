#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <span>

namespace anchord {

/// Value in the middle of the sorted values; of an even number the upper of the two. Reorders them.
/// values  at least one, none NaN
inline double upper_median(std::span<double> values) {
  std::size_t rank = values.size() / 2;
  constexpr std::size_t many = 400, n_sample = 63, about = 8;
  if (values.size() >= many) {
    // Of so many a sample says between which two values the middle is, as a rule; they come to the front.
    std::array<double, n_sample> sample;
    for (std::size_t i = 0; i < n_sample; ++i) sample[i] = values[i * values.size() / n_sample];
    std::ranges::sort(sample);
    const double least = sample[n_sample / 2 - about], most = sample[n_sample / 2 + about];
    std::size_t below = 0, between = 0;
    for (double& value : values) {
      const double here = value;
      value = values[between];
      values[between] = here;
      below += here < least ? 1 : 0;
      between += here >= least && here <= most ? 1 : 0;
    }
    if (below <= rank && rank < below + between) {
      values = values.first(between);
      rank -= below;
    }
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Median; of an even number the mean of the two in the middle. Reorders them.
/// values  at least one, none NaN
inline double median(std::span<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  if (values.size() % 2 == 1) return *middle;
  return 0.5 * (*middle + *std::ranges::max_element(values.first(values.size() / 2)));
}

}  // namespace anchord
