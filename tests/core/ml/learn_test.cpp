#include "core/ml/learn.hpp"

#include <gtest/gtest.h>

#include "core/ml/evaluate.hpp"
#include "tests/core/ml/learning_world.hpp"

namespace anchord::ml::learn_test {
namespace {

Dataset world(std::uint64_t seed, bool with_truth) { return learning_world(seed, with_truth); }

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
  std::stop_source stop;
  LearnOptions options;
  options.run.stop = stop.get_token();
  options.progress = [&](double, const std::string&) { stop.request_stop(); };
  const auto learned = learn(world(1, false), options);
  ASSERT_FALSE(learned);
  EXPECT_EQ(learned.error().code, Errc::canceled);
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

// A cap above what the usual threshold gives away must not give away more.
TEST(Learn, ACapNeverRaisesTheFalsePositiveRate) {
  const auto data = world(4, false);
  LearnOptions options;
  const auto usual = learn(data, options);
  ASSERT_TRUE(usual);
  const double before = confusion_at(usual.value().p_los, data.los, 0.5).fpr();
  for (const double cap : {0.02, 0.1, 0.3, 1.0}) {
    options.max_fpr = cap;
    const auto capped = learn(data, options);
    ASSERT_TRUE(capped);
    const double after =
        confusion_at(capped.value().p_los, data.los, capped.value().model.classifier->threshold).fpr();
    EXPECT_LE(after, std::min(cap, before)) << cap;
  }
}

}  // namespace anchord::ml::learn_test
