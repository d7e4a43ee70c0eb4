#include "core/ml/importance.hpp"

#include <gtest/gtest.h>

#include "core/ml/random.hpp"

namespace anchord::ml::importance_test {
namespace {

// The class hangs on "strong", a little on "weak", and not at all on "noise".
Dataset world() {
  Dataset d;
  d.features = {"noise", "weak", "strong"};
  Random r{11};
  for (std::uint32_t i = 0; i < 600; ++i) {
    const double noise = r.uniform(), weak = r.uniform(), strong = r.uniform();
    d.x.insert(d.x.end(), {noise, weak, strong});
    d.los.push_back(strong + 0.3 * weak > 0.65);
    d.weight.push_back(1);
    d.placement.push_back(i);
    d.group.push_back(i % 6);
  }
  return d;
}

Recipe forest() {
  Recipe r;
  r.method = Method::random_forest;
  r.forest.trees = 40;
  r.features = world().features;
  return r;
}

}  // namespace

TEST(PermutationImportance, OrdersFeaturesByWhatTheyDecide) {
  const auto importance = permutation_importance(world(), forest(), true);
  ASSERT_TRUE(importance);
  EXPECT_EQ(importance.value()[0].feature, "strong");
  EXPECT_EQ(importance.value()[1].feature, "weak");
  EXPECT_EQ(importance.value()[2].feature, "noise");
  EXPECT_NEAR(importance.value()[2].mean, 0, 0.1);
  EXPECT_EQ(importance.value()[0].mean, permutation_importance(world(), forest(), true).value()[0].mean);
}

TEST(ForwardFilter, KeepsWhatHelpsAndLeavesNoiseOut) {
  const auto data = world();
  Recipe logistic;
  logistic.method = Method::logistic;
  const auto steps = forward_filter(data, logistic, {"strong", "noise", "weak"},
                                    grouped_folds(data.group, 6, 1), true, 0.01);
  ASSERT_TRUE(steps);
  EXPECT_TRUE(steps.value()[0].kept);
  EXPECT_FALSE(steps.value()[1].kept);
  EXPECT_TRUE(steps.value()[2].kept);
}

TEST(ForwardFilter, RefusesAFeatureThatIsNotThere) {
  const auto data = world();
  EXPECT_FALSE(forward_filter(data, forest(), {"absent"}, grouped_folds(data.group, 6, 1), true));
}

}  // namespace anchord::ml::importance_test
