#include "core/nlos/cir.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

namespace anchord::nlos::cir_test {
namespace {

// One nanosecond a tap, no noise taps, a window of 100 taps from the first path on: delays come out in taps.
CirOptions plain_window(std::size_t taps) {
  CirOptions o;
  o.tap_ns = 1;
  o.noise_begin = 0;
  o.noise_end = 0;
  o.window_before = 0;
  o.window_after = taps - 1;
  return o;
}

}  // namespace

// w equal taps in a window of n: |h| is Bernoulli with p = w / n, so kurtosis = (1 - 3 p (1 - p)) / (p (1 -
// p)); delays are those of a discrete uniform variable: (w - 1) / 2 and sqrt((w^2 - 1) / 12).
TEST(CirShape, OfARectangleMatchesTheClosedForm) {
  std::vector<float> h(200, 0.0F);
  for (std::size_t k = 50; k < 50 + 21; ++k) h[k] = 700.0F;
  const auto shape = cir_shape(h, 50.0, plain_window(100));
  ASSERT_TRUE(shape);
  const double p = 0.21;
  EXPECT_NEAR(shape->kurtosis, (1 - 3 * p * (1 - p)) / (p * (1 - p)), 1e-9);
  EXPECT_NEAR(shape->mean_excess_delay_ns, 10, 1e-12);
  EXPECT_NEAR(shape->rms_delay_spread_ns, std::sqrt((21.0 * 21.0 - 1) / 12), 1e-9);
  EXPECT_NEAR(shape->early_energy, 13.0 / 21.0, 1e-12);
  EXPECT_NEAR(shape->energy, 21 * 700.0 * 700.0, 1e-6);
}

// Powers P1 at 0 and P2 at T: mean T P2 / (P1 + P2), spread T sqrt(P1 P2) / (P1 + P2).
TEST(CirShape, OfTwoDeltasMatchesTheClosedForm) {
  std::vector<float> h(200, 0.0F);
  h[60] = 300.0F;
  h[100] = 600.0F;
  const auto shape = cir_shape(h, 60.0, plain_window(100));
  ASSERT_TRUE(shape);
  EXPECT_NEAR(shape->mean_excess_delay_ns, 40 * 4.0 / 5.0, 1e-12);
  EXPECT_NEAR(shape->rms_delay_spread_ns, 40 * 2.0 / 5.0, 1e-9);
  EXPECT_NEAR(shape->peak_delay_ns, 40, 1e-12);
  EXPECT_NEAR(shape->early_energy, 0.2, 1e-12);
}

// Power r^k: a geometric variable, mean r / (1 - r), variance r / (1 - r)^2; 300 taps leave 1e-13 of it out.
TEST(CirShape, OfAnExponentialDecayMatchesTheClosedForm) {
  const double r = 0.9;
  std::vector<float> h(400, 0.0F);
  for (std::size_t k = 0; k < 300; ++k)
    h[50 + k] = static_cast<float>(1e4 * std::pow(r, 0.5 * static_cast<double>(k)));
  const auto shape = cir_shape(h, 50.0, plain_window(300));
  ASSERT_TRUE(shape);
  EXPECT_NEAR(shape->mean_excess_delay_ns, r / (1 - r), 1e-5);  // floats carry seven digits
  EXPECT_NEAR(shape->rms_delay_spread_ns, std::sqrt(r) / (1 - r), 1e-5);
}

// A record of noise with a decaying path, and the 128 taps from 672 on that a tag reads of it.
TEST(CirShape, IsTheSameForAWholeRecordAndTheWindowATagReads) {
  std::vector<float> whole;
  std::uint32_t state = 1;
  const auto uniform = [&state] {
    state = state * 1664525U + 1013904223U;
    return (static_cast<double>(state >> 8) + 0.5) / 16777216.0;
  };
  for (int k = 0; k < 1016; ++k) {
    const double noise = 30 * std::sqrt(-2 * std::log(uniform()));  // Rayleigh: rms 30 sqrt 2
    const double path = k < 746 ? 0 : 4000 * std::exp(-0.05 * (k - 746)) * uniform();
    whole.push_back(static_cast<float>(std::hypot(noise, path)));
  }
  const std::vector<float> window(whole.begin() + 672, whole.begin() + 800);
  const auto a = cir_shape(whole, 746.4);
  ASSERT_TRUE(a && a->whole);
  CirOptions told;
  told.noise_rms = a->noise_rms;
  const auto b = cir_shape(window, 746.4 - 672, told);
  ASSERT_TRUE(b);
  EXPECT_FALSE(b->whole) << "of a window nobody can say what the whole record is like";
  EXPECT_NEAR(a->kurtosis, b->kurtosis, 1e-9);
  EXPECT_NEAR(a->mean_excess_delay_ns, b->mean_excess_delay_ns, 1e-9);
  EXPECT_NEAR(a->rms_delay_spread_ns, b->rms_delay_spread_ns, 1e-9);
  EXPECT_NEAR(a->early_energy, b->early_energy, 1e-12);
  EXPECT_NEAR(a->peak_delay_ns, b->peak_delay_ns, 1e-9);
  // A first path so late that the record ends inside the window has no features, rather than other ones.
  EXPECT_FALSE(cir_shape(window, 90.0, told));
}

// Eq 5.5 over every tap: two equal taps 600 apart spread by 300, far beyond the printed 68.7.
TEST(CirShape, OfAWholeRecordIsAsPrintedAndCanExceedThePrintedThreshold) {
  std::vector<float> h(1016, 0.0F);
  h[100] = h[700] = 500.0F;
  CirOptions o;
  o.tap_ns = 1;
  const auto shape = cir_shape(h, 700.0, o);
  ASSERT_TRUE(shape && shape->whole);
  EXPECT_NEAR(shape->whole->rms_delay_spread_ns, 300, 1e-9);
  EXPECT_NEAR(shape->whole->mean_excess_delay_ns, -300, 1e-9);
  const double p = 2.0 / 1016;  // |h| is Bernoulli
  EXPECT_NEAR(shape->whole->kurtosis, (1 - 3 * p * (1 - p)) / (p * (1 - p)), 1e-6);
}

// Two passes over each number in turn, in long double, by the printed formulas.
TEST(CirShape, OfRandomRecordsMatchesThePrintedFormulasTakenOneTapAtATime) {
  std::uint32_t state = 7;
  const auto part = [&state](int most) {
    state = state * 1664525U + 1013904223U;
    return static_cast<std::int16_t>(static_cast<int>(state >> 8) % (2 * most + 1) - most);
  };
  for (const std::size_t n : {1016, 992, 1013, 800, 811}) {
    std::vector<std::int16_t> re_im;
    for (std::size_t k = 0; k < n; ++k)
      for (int i = 0; i < 2; ++i) re_im.push_back(part(k < 746 ? 90 : 6000 / static_cast<int>(k - 740)));
    re_im[4] = re_im[5] = re_im[1500] = re_im[1501] = -32768;  // the strongest there is
    re_im[1504] = re_im[1505] = 0;
    const double fp = 746.3;
    const auto shape = cir_shape(re_im, fp);
    ASSERT_TRUE(shape);

    using Real = long double;
    std::vector<Real> power;
    for (std::size_t k = 0; k < n; ++k)
      power.push_back(static_cast<Real>(re_im[2 * k]) * re_im[2 * k] +
                      static_cast<Real>(re_im[2 * k + 1]) * re_im[2 * k + 1]);
    const auto kurtosis = [&](std::size_t begin, std::size_t end) {
      Real mean = 0, m2 = 0, m4 = 0;
      for (std::size_t k = begin; k < end; ++k) mean += std::sqrt(power[k]) / static_cast<Real>(end - begin);
      for (std::size_t k = begin; k < end; ++k) {
        const Real d = (std::sqrt(power[k]) - mean) * (std::sqrt(power[k]) - mean);
        m2 += d / static_cast<Real>(end - begin);
        m4 += d * d / static_cast<Real>(end - begin);
      }
      return static_cast<double>(m4 / (m2 * m2));
    };
    const auto delays_ns = [&](std::size_t begin, std::size_t end, Real keep, Real less) {
      Real all = 0, mean = 0, square = 0;
      const auto q = [&](std::size_t k) { return power[k] > keep ? power[k] - less : 0; };
      for (std::size_t k = begin; k < end; ++k) all += q(k);
      for (std::size_t k = begin; k < end; ++k) mean += q(k) / all * (static_cast<Real>(k) - fp);
      for (std::size_t k = begin; k < end; ++k) {
        const Real d = static_cast<Real>(k) - fp - mean;
        square += q(k) / all * d * d;
      }
      const Real tap_ns = CirOptions{}.tap_ns;
      return std::pair{static_cast<double>(mean * tap_ns), static_cast<double>(std::sqrt(square) * tap_ns)};
    };
    Real noise = 0, from_window = 0;
    for (std::size_t k = 50; k < 650; ++k) noise += power[k] / 600;
    for (std::size_t k = 741; k < n; ++k) from_window += power[k] - noise;
    EXPECT_NEAR(shape->noise_rms, static_cast<double>(std::sqrt(noise)), 1e-11);
    EXPECT_NEAR(shape->energy / static_cast<double>(from_window), 1, 1e-12);
    EXPECT_NEAR(shape->kurtosis / kurtosis(741, 791), 1, 1e-12) << n;
    const auto [mean_ns, rms_ns] = delays_ns(741, 791, 9 * noise, noise);
    EXPECT_NEAR(shape->mean_excess_delay_ns, mean_ns, 1e-12 * rms_ns) << n;
    EXPECT_NEAR(shape->rms_delay_spread_ns / rms_ns, 1, 1e-12) << n;
    EXPECT_NEAR(shape->peak_delay_ns, (750 - fp) * CirOptions{}.tap_ns, 1e-12);
    ASSERT_EQ(shape->whole.has_value(), n >= 992);
    if (!shape->whole) continue;
    const auto [whole_mean_ns, whole_rms_ns] = delays_ns(0, n, -1, 0);
    EXPECT_NEAR(shape->whole->kurtosis / kurtosis(0, n), 1, 1e-12) << n;
    EXPECT_NEAR(shape->whole->mean_excess_delay_ns, whole_mean_ns, 1e-12 * whole_rms_ns) << n;
    EXPECT_NEAR(shape->whole->rms_delay_spread_ns / whole_rms_ns, 1, 1e-12) << n;

    CirOptions narrow;
    narrow.wide_registers = false;
    const auto same = cir_shape(re_im, fp, narrow);
    ASSERT_TRUE(same && same->whole);
    EXPECT_EQ(same->kurtosis, shape->kurtosis);
    EXPECT_EQ(same->rms_delay_spread_ns, shape->rms_delay_spread_ns);
    EXPECT_EQ(same->early_energy, shape->early_energy);
    EXPECT_EQ(same->energy, shape->energy);
    EXPECT_EQ(same->whole->kurtosis, shape->whole->kurtosis);
    EXPECT_EQ(same->whole->rms_delay_spread_ns, shape->whole->rms_delay_spread_ns);

    CirOptions window_only;
    window_only.whole_record = false;
    const auto less = cir_shape(re_im, fp, window_only);
    ASSERT_TRUE(less);
    EXPECT_FALSE(less->whole);
    EXPECT_EQ(less->kurtosis, shape->kurtosis);
    EXPECT_EQ(less->energy, shape->energy);
  }
}

// Every other noise tap at the limit of its numbers and all from the path on: powers 2^31, of noise 2^30 in
// the mean. Of the 50 equal taps of a window from -5 on the mean is 19.5. Once the window ends with the
// record.
TEST(CirShape, OfTheStrongestTapsAddsUpExactly) {
  for (const std::size_t path : {746U, 971U}) {
    std::vector<std::int16_t> re_im(2 * 1016, -32768);
    for (std::size_t k = 0; k < path - 5; k += 2) re_im[2 * k] = re_im[2 * k + 1] = 0;
    CirOptions o;
    o.tap_ns = 1;
    o.keep_rms = 1;
    for (const bool wide : {true, false}) {
      o.wide_registers = wide;
      const auto shape = cir_shape(re_im, static_cast<double>(path), o);
      ASSERT_TRUE(shape);
      EXPECT_EQ(shape->noise_rms, 32768.0);
      EXPECT_EQ(shape->energy, static_cast<double>(1016 - (path - 5)) * 1073741824.0);
      EXPECT_NEAR(shape->mean_excess_delay_ns, 19.5, 1e-12);
      EXPECT_NEAR(shape->rms_delay_spread_ns, std::sqrt((50.0 * 50.0 - 1) / 12), 1e-12);
      EXPECT_EQ(shape->early_energy, 13.0 / 50.0);
      EXPECT_EQ(shape->peak_delay_ns, -5.0);
      EXPECT_EQ(shape->first_path_energy, 3 * 2147483648.0);
    }
  }
}

TEST(CirShape, IsTheSameForComplexTapsAndTheirMagnitude) {
  std::vector<std::int16_t> re_im;
  std::vector<float> magnitude;
  for (int k = 0; k < 1016; ++k) {
    const auto re = static_cast<std::int16_t>((k * 37) % 61 - 30 + (k >= 746 && k < 760 ? 3000 : 0));
    const auto im = static_cast<std::int16_t>((k * 53) % 59 - 29);
    re_im.insert(re_im.end(), {re, im});
    magnitude.push_back(std::hypot(static_cast<float>(re), static_cast<float>(im)));
  }
  const auto a = cir_shape(re_im, 746.3);
  const auto b = cir_shape(magnitude, 746.3);
  ASSERT_TRUE(a && b);
  EXPECT_NEAR(a->kurtosis, b->kurtosis, 1e-4);
  EXPECT_NEAR(a->rms_delay_spread_ns, b->rms_delay_spread_ns, 1e-4);
}

// A ramp from noise of rms 10 (threshold 64): taps 0, 100 at 745, 746 cross 64 at 745.64.
TEST(CirShape, FindsTheFirstPathByTheInterpolatedCrossing) {
  std::vector<float> h(1016, 10.0F);
  h[745] = 0.0F;
  for (std::size_t k = 746; k < 752; ++k) h[k] = 100.0F;
  h[700] = 500.0F;  // one lonely tap is no path
  const auto shape = cir_shape(h, std::nullopt);
  ASSERT_TRUE(shape);
  EXPECT_NEAR(shape->first_path_idx, 745.64, 1e-6);
  EXPECT_NEAR(shape->noise_rms, 10, 1e-6);
}

TEST(CirShape, HasNoValueWithoutSignalOrWithAnImpossibleFirstPath) {
  EXPECT_FALSE(cir_shape(std::vector<float>(1016, 5.0F), std::nullopt));
  EXPECT_FALSE(cir_shape(std::vector<float>(1016, 0.0F), 746.0));
  EXPECT_FALSE(cir_shape(std::vector<float>{}, 0.0));
  EXPECT_FALSE(cir_shape(std::vector<float>(1016, 5.0F), 2000.0));
  EXPECT_FALSE(cir_shape(std::vector<float>(1016, 5.0F), -3.0));
  EXPECT_FALSE(cir_shape(std::vector<float>(1016, 5.0F), std::nan("")));
}

}  // namespace anchord::nlos::cir_test
