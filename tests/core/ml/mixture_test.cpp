#include "core/ml/mixture.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/ml/random.hpp"
#include "core/ml/train.hpp"

namespace anchord::ml::mixture_test {

// erfcx(1) = 0.427583576155807..., erfcx(10) = 0.0561409927438226 (Abramowitz and Stegun 7.1; asymptotic
// series).
TEST(Erfcx, MatchesPublishedValuesOnBothBranches) {
  EXPECT_NEAR(erfcx(0), 1, 1e-15);
  EXPECT_NEAR(erfcx(1), 0.427583576155807, 1e-12);
  EXPECT_NEAR(erfcx(10), 0.0561409927438226, 1e-12);
  EXPECT_NEAR(erfcx(4.9999999), erfcx(5.0000001), 1e-7);
}

TEST(BiasDensity, IntegratesToOneAndItsQuantilesInvertItsCdf) {
  const BiasDensity f{0.4, 0.1, 0.02, 0.05, 0.1, 0.08, 0.5};
  double sum = 0;
  for (double e = -10; e < 20; e += 1e-3) sum += 1e-3 * std::exp(f.log_density(e));
  EXPECT_NEAR(sum, 1, 2e-3);
  double below = 0;
  for (double e = -10; e < 0.3; e += 1e-3) below += 1e-3 * std::exp(f.log_density(e));
  EXPECT_NEAR(below, f.cdf(0.3), 2e-3);
  EXPECT_NEAR(f.cdf(f.quantile(0.5)), 0.5, 1e-3);
}

// mean .5 * .02 + .5 * (.1 + .5); variance by the law of total variance.
TEST(BiasDensity, MomentsByHand) {
  const BiasDensity f{0.5, 0.0, 0.02, 0.05, 0.1, 0.08, 0.5};
  EXPECT_NEAR(f.mean_m(), 0.31, 1e-12);
  const double within = 0.5 * 0.0025 + 0.5 * (0.0064 + 0.25), between = 0.25 * 0.58 * 0.58;
  EXPECT_NEAR(f.sigma_m(), std::sqrt(within + between), 1e-12);
}

// A certain LOS link is moved by the LOS offset, a certain NLOS link by about the median of its delay.
TEST(BiasMixture, FitRecoversTheWorldItWasDrawnFrom) {
  Random r{4};
  std::vector<double> x, bias, p, w;
  std::vector<std::uint8_t> los;
  for (int i = 0; i < 1500; ++i) {
    const bool is_los = i % 2 == 0;
    double noise = -6;
    for (int k = 0; k < 12; ++k) noise += r.uniform();
    x.push_back(r.uniform());
    bias.push_back(0.2 + 0.05 * noise + (is_los ? 0 : -0.6 * std::log(1 - r.uniform())));
    los.push_back(is_los);
    p.push_back(is_los ? 0.95 : 0.05);
    w.push_back(1);
  }
  const auto m = fit_mixture({x, 1, bias, w, p, los, {}, {0}, 0});
  ASSERT_TRUE(m);
  EXPECT_NEAR(m.value().shared.centre_m, 0.2, 0.01);
  EXPECT_NEAR(m.value().s0_m, 0.05, 0.01);
  const std::vector<double> at{0.5};
  EXPECT_NEAR(m.value().tau_m(at), 0.6, 0.08);
  EXPECT_NEAR(density_of(m.value(), 0.99, at).quantile(0.5), 0.2, 0.02);
  EXPECT_NEAR(density_of(m.value(), 0.01, at).quantile(0.5), 0.2 + 0.6 * std::log(2.0), 0.06);
}

TEST(BiasMixture, RefusesASingleClass) {
  const std::vector<double> x(20, 1.0), bias(20, 0.1), w(20, 1.0), p(20, 0.9);
  const std::vector<std::uint8_t> los(20, 1);
  EXPECT_EQ(fit_mixture({x, 1, bias, w, p, los, {}, {}, 0}).error().code, Errc::too_few_observations);
}

}  // namespace anchord::ml::mixture_test
