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

// 23 m is what ranges in nanoseconds, read as metres, teach a model of ten-metre rooms.
TEST(Predictor, WithholdsACorrectionThatNoRadioNeeds) {
  const auto made = Predictor::make({{}, {}, {}, constant_bias(Task::bias, 23, 1)});
  ASSERT_TRUE(made);
  FeatureVector f;
  f.set(Feature::range_m, 0.5);
  const auto v = made.value().predict(f);
  EXPECT_FALSE(v.bias_m);
  EXPECT_FALSE(v.sigma_m);
  EXPECT_EQ(v.withheld, Withheld::implausible);
  EXPECT_EQ(v.withheld_m, 23);
  EXPECT_TRUE(v.spoke.none()) << "it gave nothing";
  // Short ranges may be late by more than their length.
  const auto wall = Predictor::make({{}, {}, {}, constant_bias(Task::bias, 1.2, 1)});
  EXPECT_EQ(wall.value().predict(f).bias_m, 1.2);
  EXPECT_TRUE(plausible_correction(30, 9));
  EXPECT_FALSE(plausible_correction(30, 11));
  EXPECT_FALSE(plausible_correction(6, 3.5)) << "more than half of the range";
  EXPECT_FALSE(plausible_correction(3, -4)) << "more than twice as far";
}

// The scaler is of mean 0 and sd 1: 11 m is 11 sd away.
TEST(Predictor, WithholdsTheCorrectionOfARangeFarFromTheTrainingRows) {
  const auto made = Predictor::make({{}, {}, {}, constant_bias(Task::bias, 0.3, 0.1)});
  ASSERT_TRUE(made);
  FeatureVector f;
  f.set(Feature::range_m, 9.9);
  EXPECT_EQ(made.value().predict(f).bias_m, 0.3);
  f.set(Feature::range_m, 11);
  const auto v = made.value().predict(f);
  EXPECT_FALSE(v.bias_m);
  EXPECT_EQ(v.withheld, Withheld::far_features);
  EXPECT_TRUE(v.outside_training);
  EXPECT_EQ(made.value().predict(f, Correction::none).withheld, Withheld::no) << "nothing was to be applied";
}

TEST(Predictor, WithholdsACorrectionFarBeyondTheBiasesOfTheTraining) {
  auto m = classifier();
  m->info.task = Task::bias;
  m->mixture.emplace();
  m->mixture->m1_m = 5, m->mixture->m0_m = 5;
  const auto with = [&](std::optional<BiasMixture::Seen> seen) {
    m->mixture->seen = seen;
    return Predictor::make({{}, {}, {}, m}).value().predict([] {
      auto f = sample(0);
      f.set(Feature::range_m, 20);
      return f;
    }());
  };
  EXPECT_TRUE(with(std::nullopt).bias_m) << "a model of an older program does not say what it saw";
  EXPECT_TRUE(with(BiasMixture::Seen{0, 3}).bias_m);
  const auto far = with(BiasMixture::Seen{0, 1});
  EXPECT_FALSE(far.bias_m);
  EXPECT_EQ(far.withheld, Withheld::unseen_bias);
  EXPECT_TRUE(far.p_los) << "the class is another matter";
}

}  // namespace anchord::ml::predictor_test
