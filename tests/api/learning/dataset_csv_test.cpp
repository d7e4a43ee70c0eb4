#include "api/imports/dataset_csv.hpp"

#include <gtest/gtest.h>

#include "tests/core/ml/learning_world.hpp"

namespace anchord::api {

TEST(DatasetCsv, OutAndInAgainHasTheSameDigestAndSplit) {
  for (const auto aggregation : {ml::Aggregation::none, ml::Aggregation::mean, ml::Aggregation::median}) {
    const auto frozen = ml::freeze(ml::learning_world(1, true), {aggregation, {"room 2"}, 0, 1});
    ASSERT_TRUE(frozen) << frozen.error().message;
    const auto again = read_dataset_csv(write_dataset_csv(frozen.value()));
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again.value().digest, frozen.value().digest);
    EXPECT_EQ(again.value().test_places, std::vector<std::string>{"room 2"});
    EXPECT_EQ(again.value().data.rows(), frozen.value().data.rows());
    EXPECT_EQ(again.value().split.test_rows, frozen.value().split.test_rows);
  }
}

// Eight repeats a placement, sixty placements: 6.2.1 leaves one row of each, the mean of its bias.
TEST(DatasetCsv, AggregatesToTheMeanOfEachMeasurementPoint) {
  const auto data = ml::learning_world(1, true);
  const auto frozen = ml::freeze(data, {ml::Aggregation::mean, {}, 0, 1});
  ASSERT_TRUE(frozen);
  EXPECT_EQ(frozen.value().data.rows(), 60U);
  double mean = 0;
  for (std::size_t i = 0; i < 8; ++i) mean += data.bias_m[i] / 8;
  EXPECT_NEAR(frozen.value().data.bias_m[0], mean, 1e-12);
}

TEST(DatasetCsv, DigestChangesWithOneValueOneLabelAndTheSplit) {
  auto data = ml::learning_world(1, true);
  const auto digest = [&](std::vector<std::string> test) {
    return ml::freeze(data, {ml::Aggregation::none, std::move(test), 0, 1}).value().digest;
  };
  const auto before = digest({});
  EXPECT_EQ(digest({}), before);
  EXPECT_NE(digest({"room 1"}), before);
  data.x[7] += 1e-12;
  const auto moved = digest({});
  EXPECT_NE(moved, before);
  data.los[3] ^= 1;
  EXPECT_NE(digest({}), moved);
}

TEST(DatasetCsv, AChangedCellIsFoundByTheDigest) {
  const auto frozen = ml::freeze(ml::learning_world(1, true), {ml::Aggregation::mean, {}, 0, 1}).value();
  auto text = write_dataset_csv(frozen);
  const auto at = text.rfind('1');
  text[at] = '2';
  EXPECT_FALSE(read_dataset_csv(text));
}

TEST(DatasetCsv, TornFilesNameTheirLine) {
  const auto text =
      write_dataset_csv(ml::freeze(ml::learning_world(1, true), {ml::Aggregation::mean, {}, 0, 1}).value());
  EXPECT_EQ(read_dataset_csv("range_m,los\n1,1\n").error().code, Errc::bad_frame);
  EXPECT_EQ(read_dataset_csv(text.substr(0, text.find('\n') + 1)).error().code, Errc::bad_frame);
  for (std::size_t cut = 0; cut < text.size(); cut += 97) EXPECT_FALSE(read_dataset_csv(text.substr(0, cut)));
  const auto torn = read_dataset_csv(text + "room 9,9\n");
  EXPECT_NE(torn.error().message.find("line 63"), std::string::npos) << torn.error().message;
}

TEST(DatasetCsv, RefusesToHoldOutEverythingOrAPlaceThatIsNotThere) {
  const auto data = ml::learning_world(1, true);
  EXPECT_EQ(ml::freeze(data, {ml::Aggregation::none, {"attic"}, 0, 1}).error().code, Errc::not_found);
  EXPECT_EQ(ml::freeze(data, {ml::Aggregation::none, data.group_names, 0, 1}).error().code,
            Errc::too_few_observations);
}

}  // namespace anchord::api
