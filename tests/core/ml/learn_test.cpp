#include "core/ml/learn.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "core/ml/evaluate.hpp"
#include "core/ml/random.hpp"

namespace anchord::ml {
namespace {

// Sixty placements in six places; NLOS links read weaker first paths and arrive late.
Dataset world(std::uint64_t seed, bool with_truth) {
  Dataset d;
  d.features = {"range_m", "rx_dbm", "fp_dbm", "rx_minus_fp_db", "rx_free_space_db"};
  Random r{seed};
  for (std::uint32_t placement = 0; placement < 60; ++placement) {
    const bool los = placement % 2 == 0;
    const double range = 2 + 8 * r.uniform(), loss = los ? 1 + 2 * r.uniform() : 3 + 6 * r.uniform();
    const double excess = los ? 0 : -0.5 * std::log(1 - r.uniform());
    for (int k = 0; k < 8; ++k) {
      const double rx = -75 - 20 * std::log10(range) - (los ? 0 : 4) + r.uniform(),
                   noise = 0.04 * (r.uniform() - 0.5);
      d.x.insert(d.x.end(), {range, rx, rx - loss, loss, rx + 20 * std::log10(range)});
      d.los.push_back(los);
      if (with_truth) d.bias_m.push_back(0.15 + excess + noise);
      d.weight.push_back(1);
      d.placement.push_back(placement);
      d.group.push_back(placement / 10);
    }
  }
  return d;
}

}  // namespace

TEST(Learn, PicksAClassifierThatHoldsOnOtherPlaces) {
  const auto learned = learn(world(1, false), {});
  ASSERT_TRUE(learned) << learned.error().message;
  EXPECT_GT(confusion_at(learned.value().p_los, world(1, false).los, 0.5).accuracy(), 0.9);
  const auto fresh = world(2, false);
  const auto& features = learned.value().model.info.features;
  const auto e = evaluate(learned.value().model, fresh.with_features(features).value());
  EXPECT_GT(e.confusion->accuracy(), 0.9);
  EXPECT_EQ(learned.value().model.info.groups, 6U);
}

TEST(Learn, BiasTableStartsWithNoCorrectionAndThePickIsNotWorse) {
  const auto data = world(1, true);
  LearnOptions options;
  options.task = Task::bias;
  const auto learned = learn(data, options);
  ASSERT_TRUE(learned) << learned.error().message;
  const auto& table = learned.value().table;
  EXPECT_EQ(table.front().name, "none (no correction)");
  for (const auto& row : table) EXPECT_TRUE(!row.picked || row.error.mae_m <= table.front().error.mae_m);
  EXPECT_LT(learned.value().nll, learned.value().nll_constants);
}

TEST(Learn, OneClassBiasFindsTheConstant) {
  LearnOptions options;
  options.task = Task::los_bias;
  const auto learned = learn(world(1, true).of_class(true), options);
  ASSERT_TRUE(learned);
  const auto all = world(3, true).of_class(true);
  const auto e =
      evaluate(learned.value().model, all.with_features(learned.value().model.info.features).value());
  EXPECT_NEAR(e.all->raw.mae_m, 0.15, 0.01);
  EXPECT_LT(e.all->corrected.mae_m, 0.03);
}

// A slope fitted between 8 and 12 m must not be believed at 100 m: there the median of the training biases
// answers.
TEST(Regressor, ShrinksToTheMedianFarFromTheRowsItWasFittedTo) {
  Regressor r;
  r.scaler = {{10}, {1}, 2.5};
  r.scorer = Linear{{0.1}, 0.2};
  r.fallback_m = 0.2;
  const std::vector<double> near{11}, four_sd{14}, far{110};
  EXPECT_NEAR(r.bias_m(near), 0.3, 1e-12);
  EXPECT_NEAR(r.bias_m(four_sd), 0.2 + 0.25 / 2, 1e-12);
  EXPECT_NEAR(r.bias_m(far), 0.2, 1e-3);
}

TEST(Learn, RefusesASinglePlaceAndASingleClass) {
  auto one_place = world(1, false);
  std::fill(one_place.group.begin(), one_place.group.end(), 0U);
  EXPECT_EQ(learn(one_place, {}).error().code, Errc::too_few_observations);
  EXPECT_EQ(learn(world(1, false).of_class(true), {}).error().code, Errc::too_few_observations);
}

TEST(Learn, StopsWhenTold) {
  LearnOptions options;
  options.progress = [](const std::string&, double) { return false; };
  EXPECT_EQ(learn(world(1, false), options).error().code, Errc::canceled);
}

TEST(Learn, ThresholdKeepsTheAskedFalsePositiveRateOnHeldOutPlaces) {
  LearnOptions options;
  options.max_fpr = 0.05;
  const auto data = world(4, false);
  const auto learned = learn(data, options);
  ASSERT_TRUE(learned);
  EXPECT_LE(confusion_at(learned.value().p_los, data.los, learned.value().model.classifier->threshold).fpr(),
            0.05);
}

}  // namespace anchord::ml
