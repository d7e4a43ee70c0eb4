#include "core/base/median.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace anchord::median_test {
namespace {

double by_sorting(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

TEST(Median, IsTheMiddleOfTheSortedValuesHoweverManyAndInWhateverOrder) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal(0, 1);
  for (const std::size_t n : {1U, 2U, 7U, 99U, 100U, 101U, 400U, 1000U, 4321U}) {
    std::vector<double> scattered(n), rising(n), alike(n, 2.5), two(n), waves(n);
    for (std::size_t i = 0; i < n; ++i) {
      scattered[i] = std::abs(normal(random));
      rising[i] = static_cast<double>(i) - 17.0;
      two[i] = i % 3 == 0 ? 1.0 : -1.0;
      // A sample at even steps sees the same value always, and it is not in the middle.
      waves[i] = i % (n / 31 + 1) == 0 ? 100.0 : normal(random);
    }
    for (auto* values : {&scattered, &rising, &alike, &two, &waves}) {
      const double expected = by_sorting(*values);
      std::vector<double> sorted = *values;
      std::ranges::sort(sorted);
      std::vector<double> reordered = *values;
      EXPECT_EQ(upper_median(reordered), expected) << n;
      std::ranges::sort(reordered);
      EXPECT_EQ(reordered, sorted) << "values were lost";
      std::vector<double> other = *values;
      const double low = sorted[(n - 1) / 2];
      EXPECT_EQ(median(other), n % 2 == 1 ? expected : 0.5 * (expected + low)) << n;
    }
  }
}

}  // namespace
}  // namespace anchord::median_test
