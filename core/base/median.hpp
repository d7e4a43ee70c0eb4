#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <limits>
#include <memory>
#include <span>

namespace anchord {

/// Value in the middle of the sorted values; of an even number the upper of the two. May reorder them.
/// values  at least one, none NaN
inline double upper_median(std::span<double> values) {
  std::size_t rank = values.size() / 2;
  constexpr std::size_t many = 100, n_sample = 31, about = 6;
  std::unique_ptr<double[]> room;
  std::size_t used = 0;
  while (values.size() >= many) {
    // Of so many a sample says between which two values the one asked for is, as a rule; those are copied.
    std::array<double, n_sample> sample;
    for (std::size_t i = 0; i < n_sample; ++i) sample[i] = values[i * values.size() / n_sample];
    std::ranges::sort(sample);
    const std::size_t guess = rank * n_sample / values.size();
    const double least = guess < about ? -std::numeric_limits<double>::infinity() : sample[guess - about];
    const double most =
        guess + about >= n_sample ? std::numeric_limits<double>::infinity() : sample[guess + about];
    // Half of the values at most go on, half of those next: the room is never more than full.
    if (!room) room = std::make_unique_for_overwrite<double[]>(values.size());
    double* const to = room.get() + used;
    std::size_t below = 0, between = 0;
    for (const double value : values) {
      // No branch: which of them is taken cannot be foreseen.
      to[between] = value;
      below += static_cast<std::size_t>(value < least);
      between += static_cast<std::size_t>(value >= least) & static_cast<std::size_t>(value <= most);
    }
    if (rank < below || rank >= below + between) break;
    if (2 * between > values.size()) {
      // Most of them are alike, and the one asked for is one of those.
      const double usual = sample[guess];
      const auto n_below = std::ranges::count_if(values, [&](double value) { return value < usual; });
      const auto n_usual = std::ranges::count(values, usual);
      const auto at = static_cast<std::ptrdiff_t>(rank);
      if (n_below <= at && at < n_below + n_usual) return usual;
      break;
    }
    values = {to, between};
    used += between;
    rank -= below;
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
