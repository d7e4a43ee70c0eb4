#include "api/learning/model_artifact.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <cmath>

#include "core/ml/random.hpp"
#include "core/ml/recipe.hpp"
#include "core/nlos/features.hpp"

namespace anchord::api::model_artifact_test {
namespace {

ml::Dataset ring() {
  ml::Dataset d;
  d.features = {"range_m", "rx_dbm"};
  ml::Random r{7};
  for (std::uint32_t i = 0; i < 200; ++i) {
    const double a = r.uniform() - 0.5, b = r.uniform() - 0.5;
    d.x.insert(d.x.end(), {a, b});
    d.los.push_back(a * a + b * b < 0.1);
    d.bias_m.push_back(a * b);
    d.weight.push_back(1);
    d.group.push_back(i % 5);
    d.placement.push_back(i);
  }
  return d;
}

ml::Model model_of(ml::Method method) {
  ml::Recipe recipe;
  recipe.method = method;
  recipe.features = ring().features;
  recipe.forest.trees = 10;
  recipe.boosted.rounds = 10;
  ml::Model m;
  m.info.features = recipe.features;
  m.info.feature_set = nlos::k_feature_set_version;
  m.info.method = recipe.describe();
  m.info.metrics = {{"accuracy", 0.5}};
  m.classifier = ml::fit_classifier(ring(), recipe).value();
  return m;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const auto at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

}  // namespace

class EveryMethod : public ::testing::TestWithParam<ml::Method> {};

TEST_P(EveryMethod, PredictsTheSameAfterWritingAndReadingAndWritesTheSameBytes) {
  const auto model = model_of(GetParam());
  const auto text = write_model_artifact(model);
  const auto again = read_model_artifact(text);
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(write_model_artifact(again.value()), text);
  EXPECT_EQ(write_model_artifact(model_of(GetParam())), text);  // same seed, same data: same bytes
  const auto data = ring();
  for (std::size_t i = 0; i < data.rows(); ++i)
    EXPECT_EQ(ml::predict(model, data.row(i)).p_los, ml::predict(again.value(), data.row(i)).p_los);
}

INSTANTIATE_TEST_SUITE_P(ModelArtifact, EveryMethod,
                         ::testing::Values(ml::Method::logistic, ml::Method::random_forest, ml::Method::svm,
                                           ml::Method::boosted, ml::Method::average));

TEST(ModelArtifact, RefusesWhatIsWrongAndNamesThePlace) {
  const auto good = write_model_artifact(model_of(ml::Method::logistic));
  const auto message = [](const std::string& text) {
    const auto r = read_model_artifact(text);
    return r ? std::string{} : r.error().message;
  };
  EXPECT_NE(message(""), "");
  EXPECT_NE(message("[]"), "");
  EXPECT_NE(message("{}"), "");
  EXPECT_EQ(read_model_artifact(replaced(good, "anchord-model-1", "anchord-model-9")).error().code,
            Errc::unsupported);
  EXPECT_EQ(read_model_artifact(replaced(good, "anchord-features-2", "anchord-features-0")).error().code,
            Errc::unsupported);
  EXPECT_NE(message(replaced(good, "\"threshold\":0.5", "\"threshold\":1.5")).find("/classifier/threshold"),
            std::string::npos);
  EXPECT_NE(message(replaced(good, "\"threshold\":0.5", "\"threshold\":1e999")), "");
  EXPECT_NE(message(replaced(good, "\"slope\":", "\"slope\":null,\"x\":")).find("slope"), std::string::npos);
  EXPECT_NE(message(replaced(good, "\"sd\":[", "\"sd\":[0,")).find("/classifier/scaler/sd"),
            std::string::npos);
  EXPECT_NE(message(replaced(good, "\"seed\":0", "\"seed\":-1")).find("/manifest/seed"), std::string::npos);
}

TEST(ModelArtifact, RefusesTreesThatWouldNotEndOrReachOutside) {
  const auto good = write_model_artifact(model_of(ml::Method::random_forest));
  const auto bad_root = read_model_artifact(replaced(good, "\"roots\":[0", "\"roots\":[99999999"));
  EXPECT_FALSE(bad_root);
  const auto circle = read_model_artifact(replaced(good, "\"left\":[1", "\"left\":[0"));
  ASSERT_FALSE(circle);
  EXPECT_NE(circle.error().message.find("/left/0"), std::string::npos);
  EXPECT_FALSE(read_model_artifact(replaced(good, "\"feature\":[", "\"feature\":[7,")));
  // A chain of a million nodes would make every prediction slow.
  std::string feature = "[", left = "[", value = "[";
  for (int i = 0; i < 2001; ++i) {
    feature += (i ? "," : "") + std::string{i % 2 == 0 && i < 2000 ? "0" : "-1"};
    left += (i ? "," : "") + std::to_string(i % 2 == 0 ? i + 1 : 0);
    value += i ? ",0" : "0";
  }
  const auto at = good.find("\"feature\":[");
  const auto end = good.find("}}]", at);
  const auto chain = good.substr(0, at) + "\"feature\":" + feature + "],\"left\":" + left +
                     "],\"value\":" + value + "]" + good.substr(end);
  EXPECT_FALSE(read_model_artifact(chain));
}

TEST(ModelArtifact, RefusesEveryTruncationQuickly) {
  const auto good = write_model_artifact(model_of(ml::Method::logistic));
  const auto start = std::chrono::steady_clock::now();
  for (std::size_t n = 0; n + 2 < good.size(); ++n)
    EXPECT_FALSE(read_model_artifact(std::string_view{good}.substr(0, n))) << n;
  EXPECT_FALSE(read_model_artifact(std::string(1000000, '[')));
  EXPECT_LT(std::chrono::steady_clock::now() - start,
            std::chrono::seconds(20));  // milliseconds; room for a loaded machine and sanitizers
}

TEST(ModelArtifact, KeepsTheBiasMixture) {
  auto model = model_of(ml::Method::logistic);
  model.info.task = ml::Task::bias;
  model.mixture = ml::BiasMixture{};
  model.mixture->shared = {0.1, 0.5, {0}, {1.0}, {2.0}, {0.0}, {3.0}, {0.05}, 0.02};
  model.mixture->tail = {{1, -80, 3, 0.4}};
  const auto again = read_model_artifact(write_model_artifact(model));
  ASSERT_TRUE(again) << again.error().message;
  const std::vector<double> x{0.2, -0.1};
  EXPECT_EQ(ml::predict(model, x).bias_m, ml::predict(again.value(), x).bias_m);
  EXPECT_EQ(ml::predict(model, x).sigma_m, ml::predict(again.value(), x).sigma_m);
}

// A delay that nobody took off: the reader takes no bias beyond 100 m, and so no writer may keep one.
TEST(ModelArtifact, WhatItsOwnReaderRefusesIsNotKept) {
  auto model = model_of(ml::Method::logistic);
  EXPECT_EQ(checked_model_artifact(model).value(), write_model_artifact(model));
  model.info.task = ml::Task::bias;
  model.mixture.emplace();
  model.mixture->shared.centre_m = 154;
  const auto refused = checked_model_artifact(model);
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("/mixture/shared/centre_m: out of range: 154, may be -100 to 100"),
            std::string::npos)
      << refused.error().message;
  model.mixture->shared.centre_m = 0.5;
  model.info.metrics = {{"mae_m", std::nan("")}};
  EXPECT_FALSE(checked_model_artifact(model));
  model.info.metrics.clear();
  model.mixture->seen = ml::BiasMixture::Seen{-0.1, 2.5};
  const auto kept = read_model_artifact(checked_model_artifact(model).value());
  ASSERT_TRUE(kept) << kept.error().message;
  EXPECT_EQ(kept.value().mixture->seen->max_m, 2.5);
}

}  // namespace anchord::api::model_artifact_test
