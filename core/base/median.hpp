#pragma once

#include <algorithm>
#include <span>

namespace anchord {

/// Value in the middle of the sorted values; of an even number the upper of the two. Reorders them.
/// values  at least one, none NaN
inline double upper_median(std::span<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// Median; of an even number the mean of the two in the middle. Reorders them.
/// values  at least one, none NaN
inline double median(std::span<double> values) {
  const double high = upper_median(values);
  if (values.size() % 2 == 1) return high;
  return 0.5 * (high + *std::ranges::max_element(values.first(values.size() / 2)));
}

}  // namespace anchord
