#include "core/ml/dataset.hpp"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "core/base/sha256.hpp"

namespace anchord::ml::dataset_test {
namespace {

Dataset small() {
  Dataset d;
  d.features = {"a", "b"};
  d.x = {1, 10, 2, 20, 9, 30, 4, 40};
  d.los = {1, 1, 1, 0};
  d.bias_m = {0.1, 0.2, 0.9, 0.5};
  d.weight = {1, 1, 1, 1};
  d.group = {0, 0, 0, 1};
  d.placement = {0, 0, 0, 1};
  return d;
}

}  // namespace

TEST(Sha256, MatchesThePublishedVectors) {  // FIPS 180-4 examples
  Sha256 abc;
  abc.add("abc");
  EXPECT_EQ(abc.hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  Sha256 two;
  two.add("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq");
  EXPECT_EQ(two.hex(), "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(Dataset, AggregatesToMediansPerPlacement) {
  const auto d = aggregate_placements(small());
  ASSERT_EQ(d.rows(), 2U);
  EXPECT_EQ(d.x[0], 2);
  EXPECT_EQ(d.x[1], 20);
  EXPECT_EQ(d.bias_m[0], 0.2);
  EXPECT_EQ(d.los[0], 1);
  EXPECT_EQ(d.los[1], 0);
}

TEST(Dataset, ThinningLeavesEveryPlacementTheSameWeight) {
  const auto d = thin_placements(small(), 2);
  ASSERT_EQ(d.rows(), 3U);
  EXPECT_EQ(d.weight, (std::vector<double>{0.5, 0.5, 1}));
}

TEST(Dataset, DigestChangesWithAnyValueAndOnlyThen) {
  auto d = small();
  const auto before = d.digest();
  EXPECT_EQ(before, small().digest());
  d.x[3] += 1e-12;
  EXPECT_NE(d.digest(), before);
}

TEST(Dataset, RefusesAFeatureItHasNot) {
  const std::vector<std::string> names{"b", "c"};
  EXPECT_EQ(small().with_features(names).error().code, Errc::not_found);
}

TEST(GroupedFolds, NeverDivideAGroupAndRepeatForASeed) {
  std::vector<std::uint32_t> group;
  for (std::uint32_t i = 0; i < 300; ++i) group.push_back(i * i % 23);
  const auto fold = grouped_folds(group, 5, 7);
  EXPECT_EQ(fold, grouped_folds(group, 5, 7));
  EXPECT_NE(fold, grouped_folds(group, 5, 8));
  std::map<std::uint32_t, std::set<std::size_t>> folds_of;
  for (std::size_t i = 0; i < group.size(); ++i) folds_of[group[i]].insert(fold[i]);
  for (const auto& [id, folds] : folds_of) EXPECT_EQ(folds.size(), 1U);
  std::map<std::size_t, int> size;
  for (const auto f : fold) ++size[f];
  EXPECT_EQ(size.size(), 5U);
}

TEST(GroupedFolds, AreAsManyAsTheGroupsWhereThoseAreFewer) {
  const std::vector<std::uint32_t> group{4, 4, 9};
  EXPECT_EQ(std::set<std::size_t>({grouped_folds(group, 5, 1)[0], grouped_folds(group, 5, 1)[2]}).size(), 2U);
}

TEST(RangeOutliers, AreFarFromTheirPlacementsMedian) {
  std::vector<double> range(20, 5.0);
  for (std::size_t i = 0; i < 20; ++i) range[i] += 0.01 * static_cast<double>(i % 5);
  range[3] = 12;
  std::vector<std::uint32_t> placement(20, 1);
  EXPECT_EQ(range_outliers(range, placement), std::vector<std::size_t>{3});
  EXPECT_TRUE(range_outliers(std::vector<double>{1, 9}, std::vector<std::uint32_t>{0, 0}).empty());
}

// Biases of 0, 0.1, 0.2 m: their median is 0.1 m and 1.4826 MAD 0.14826 m, the scatter s. A truth known to s
// itself halves a row's weight, s^2 / (s^2 + s^2), beside 1 of the others; the mean stays 1.
TEST(Dataset, AWorseTruthWeighsLess) {
  Dataset data;
  data.bias_m = {0.0, 0.1, 0.2};
  data.weight = {1, 1, 1};
  data.group = {0, 0, 0}, data.placement = {0, 1, 2};
  const std::vector<std::optional<double>> sigma_m{std::nullopt, 0.14826, 0.0};
  weigh_by_truth(data, sigma_m);
  EXPECT_NEAR(data.weight[0], 1 / 2.5 * 3, 1e-9);
  EXPECT_NEAR(data.weight[1], 0.5 / 2.5 * 3, 1e-9);
  EXPECT_NEAR(data.weight[2], 1 / 2.5 * 3, 1e-9);
  // Thinning and the weights of placements keep it.
  EXPECT_NEAR(thin_placements(data, 5).weight[1], 0.6, 1e-9);
}

TEST(Dataset, WithoutAnyTruthSigmaEveryRowWeighsOne) {
  Dataset data;
  data.bias_m = {0.0, 0.5};
  data.weight = {1, 1};
  data.group = {0, 1}, data.placement = {0, 1};
  const auto digest = data.digest();
  weigh_by_truth(data, std::vector<std::optional<double>>(2));
  EXPECT_EQ(data.weight, (std::vector<double>{1, 1}));
  EXPECT_EQ(data.digest(), digest);
}

}  // namespace anchord::ml::dataset_test
