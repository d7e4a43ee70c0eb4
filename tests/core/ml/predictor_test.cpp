#include "core/ml/predictor.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace anchord::ml::predictor_test {
namespace {

using nlos::Feature;
using nlos::FeatureVector;

Scaler plain(std::size_t n) { return {std::vector<double>(n, 0.0), std::vector<double>(n, 1.0), 0}; }

// P(LOS) = sigmoid(rx_minus_fp_db).
std::shared_ptr<Model> classifier() {
  auto m = std::make_shared<Model>();
  m->info.task = Task::nlos_id;
  m->info.features = {"rx_minus_fp_db"};
  m->classifier.emplace();
  m->classifier->scaler = plain(1);
  m->classifier->members.push_back({Linear{{1.0}, 0}});
  return m;
}

std::shared_ptr<Model> constant_bias(Task task, double bias_m, double sigma_m) {
  auto m = std::make_shared<Model>();
  m->info.task = task;
  m->info.features = {"range_m"};
  m->regressor.emplace();
  m->regressor->scaler = plain(1);
  m->regressor->scorer = Linear{{0.0}, bias_m};
  m->regressor->fallback_m = bias_m;
  m->regressor->sigma_m = sigma_m;
  return m;
}

FeatureVector sample(double difference_db) {
  FeatureVector f;
  f.set(Feature::range_m, 2.0);
  f.set(Feature::rx_minus_fp_db, difference_db);
  return f;
}

}  // namespace

TEST(Predictor, WeighsBothBiasesByTheProbability) {
  const auto made = Predictor::make(
      {classifier(), constant_bias(Task::los_bias, 0.1, 0.05), constant_bias(Task::nlos_bias, 0.6, 0.3), {}});
  ASSERT_TRUE(made) << made.error().message;
  const auto v = made.value().predict(sample(std::log(3.0)));  // P = 3 / 4
  EXPECT_NEAR(*v.p_los, 0.75, 1e-12);
  EXPECT_TRUE(*v.los);
  EXPECT_NEAR(*v.bias_m, 0.75 * 0.1 + 0.25 * 0.6, 1e-12);
  // Variance of the two-Gaussian mixture by hand: sum p (s^2 + m^2) - mean^2.
  EXPECT_NEAR(*v.sigma_m * *v.sigma_m, 0.75 * (0.0025 + 0.01) + 0.25 * (0.09 + 0.36) - 0.225 * 0.225, 1e-12);
  EXPECT_NEAR(v.likelihood->nlos_m, 0.6, 1e-12);
}

TEST(Predictor, SaysWhichModelsGaveTheAnswer) {
  const auto spoke = [](ModelSet set, const nlos::FeatureVector& f) {
    return Predictor::make(std::move(set)).value().predict(f).spoke.to_string();  // bias, nlos, los, id
  };
  EXPECT_EQ(spoke({classifier(), {}, {}, {}}, sample(1)), "0001");
  EXPECT_EQ(spoke({classifier(),
                   constant_bias(Task::los_bias, 0.1, 0.05),
                   constant_bias(Task::nlos_bias, 0.6, 0.3),
                   {}},
                  sample(1)),
            "0111");
  FeatureVector bare;
  bare.set(Feature::range_m, 2.0);
  EXPECT_EQ(spoke({classifier(), {}, {}, constant_bias(Task::bias, 0.1, 0.05)}, bare), "1000")
      << "the classifier could not speak";
}

TEST(Predictor, HardSwitchTakesTheBiasOfTheClassCalled) {
  const auto made = Predictor::make(
      {classifier(), constant_bias(Task::los_bias, 0.1, 0.05), constant_bias(Task::nlos_bias, 0.6, 0.3), {}});
  ASSERT_TRUE(made);
  EXPECT_NEAR(*made.value().predict(sample(1), Correction::hard).bias_m, 0.1, 1e-12);
  EXPECT_NEAR(*made.value().predict(sample(-1), Correction::hard).bias_m, 0.6, 1e-12);
}

TEST(Predictor, SaysNothingOfASampleThatLacksItsFeature) {
  const auto made = Predictor::make({classifier(), {}, {}, {}});
  ASSERT_TRUE(made);
  FeatureVector f;
  f.set(Feature::range_m, 2.0);
  const auto v = made.value().predict(f);
  EXPECT_FALSE(v.p_los);
  EXPECT_FALSE(v.bias_m);
}

// Its shapes of the impulse response were over another window; its levels are what they were.
TEST(Predictor, TakesAModelOfTheFeaturesBeforeWhereTheyMeanTheSame) {
  auto levels = classifier();
  levels->info.feature_set = nlos::k_feature_set_before;
  EXPECT_TRUE(Predictor::make({levels, {}, {}, {}}));
  auto shape = classifier();
  shape->info.features = {"kurtosis"};
  shape->info.feature_set = nlos::k_feature_set_before;
  const auto refused = Predictor::make({shape, {}, {}, {}});
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("kurtosis"), std::string::npos) << refused.error().message;
}

TEST(Predictor, RefusesAModelInTheWrongSlotAndColumnsLiveRangesLack) {
  EXPECT_EQ(Predictor::make({constant_bias(Task::los_bias, 0, 1), {}, {}, {}}).error().code,
            Errc::invalid_argument);
  auto odd = classifier();
  odd->info.features = {"grp1"};
  EXPECT_EQ(Predictor::make({odd, {}, {}, {}}).error().code, Errc::not_found);
}

TEST(Predictor, MarksSamplesOutsideTheTrainingRows) {
  const auto made = Predictor::make({classifier(), {}, {}, {}});
  ASSERT_TRUE(made);
  EXPECT_FALSE(made.value().predict(sample(2.9)).outside_training);
  EXPECT_TRUE(made.value().predict(sample(3.1)).outside_training);
}

}  // namespace anchord::ml::predictor_test
