// Frozen data sets: the one CSV form of the service and the command line.
#include <gtest/gtest.h>

#include <cmath>

#include "api/formats/labelled_table.hpp"
#include "api/learning/freeze_rows.hpp"

namespace anchord::api::frozen_table_test {
namespace {

using nlos::Feature;

/// Three rooms of four settings of three repeats; every other setting behind a wall.
DatasetTable rooms() {
  DatasetTable out;
  out.registers = {"fp_amp1", "grp1"};
  for (int s = 0; s < 12; ++s) {
    for (int repeat = 0; repeat < 3; ++repeat) {
      DatasetRow row;
      row.campaign = "may";
      row.environment = "room " + std::to_string(s / 4);
      row.setting = "s" + std::to_string(s);
      row.los = s % 2 == 0;
      row.true_range_m = 2.1 + s;
      row.features.set(Feature::range_m, 2.1 + s + (s % 2) * 0.4 + 0.01 * repeat);
      row.features.set(Feature::rx_dbm, -80.125 - s - repeat);
      row.registers = {9000.0 + repeat, std::numeric_limits<double>::quiet_NaN()};
      out.rows.push_back(std::move(row));
    }
  }
  return out;
}

FrozenDataset frozen(Aggregation how, std::vector<std::string> test = {"room 2"}) {
  FreezeOptions options;
  options.aggregation = how;
  options.test = std::move(test);
  return freeze_rows(rooms(), options, {}).value();
}

}  // namespace

TEST(FrozenTable, OutAndInAgainIsTheSameTextWithItsSplitAndRegisters) {
  for (const auto how : {Aggregation::none, Aggregation::mean, Aggregation::median}) {
    const auto set = frozen(how);
    const auto csv = set.table.csv();
    EXPECT_TRUE(is_dataset_csv(csv));
    const auto again = DatasetTable::parse(csv);
    ASSERT_TRUE(again) << again.error().message;
    EXPECT_EQ(again.value().csv(), csv);
    const auto read = frozen_before(again.value());
    EXPECT_EQ(read.n_test, set.n_test);
    EXPECT_EQ(read.report_json, frozen_before(set.table).report_json);
    // A register no row has is no column.
    EXPECT_EQ(again.value().registers, std::vector<std::string>{"fp_amp1"});
  }
}

// 2.1 m, 2.11 m and 2.12 m have the mean 2.11 m; the truth of equal repeats stays the very number it was.
TEST(FrozenTable, AggregatesToOneRowOfEachSetting) {
  const auto set = frozen(Aggregation::mean);
  ASSERT_EQ(set.table.rows.size(), 12U);
  const auto& row = set.table.rows.front();
  EXPECT_NEAR(row.range_m(), 2.11, 1e-12);
  EXPECT_EQ(row.true_range_m, 2.1);
  EXPECT_EQ(row.repeats, 3U);
  EXPECT_EQ(row.registers[0], 9001);
  EXPECT_TRUE(frozen(Aggregation::median).table.rows.front().features.get(Feature::log_range_spread));
}

TEST(FrozenTable, IsOfSingleRangesByDefault) {
  const auto set = freeze_rows(rooms(), {}, {}).value();
  EXPECT_EQ(set.table.rows.size(), 36U);
  EXPECT_EQ(not_for_live(set.table), "");
  EXPECT_NE(not_for_live(frozen(Aggregation::mean).table).find("3 rangings"), std::string::npos);
}

// ln(0.005 + sd) of 2.10 m, 2.11 m and 2.12 m, whose standard deviation is 0.01 m.
TEST(FrozenTable, MeansKeepTheStandardDeviationOfTheirRanges) {
  const auto spread = frozen(Aggregation::mean).table.rows.front().features.get(Feature::log_range_spread);
  ASSERT_TRUE(spread);
  EXPECT_NEAR(*spread, std::log(0.015), 1e-9);
}

TEST(FrozenTable, KeepsHowWellATruthIsKnownAndWeighsByIt) {
  auto table = rooms();
  EXPECT_EQ(table.csv().find("truth_sigma_m"), std::string::npos) << "no column without a value";
  for (auto& row : table.rows)
    if (row.environment == "room 1") row.truth_sigma_m = 0.5;
  const auto again = DatasetTable::parse(table.csv());
  ASSERT_TRUE(again) << again.error().message;
  EXPECT_EQ(again.value().csv(), table.csv());
  const auto rows = learning_rows(again.value(), {{"range_m"}, true, true, {}, {}}).value();
  for (std::size_t i = 0; i < rows.source.size(); ++i) {
    if (table.rows[rows.source[i]].environment == "room 1")
      EXPECT_LT(rows.data.weight[i], 0.1);
    else
      EXPECT_GT(rows.data.weight[i], 1.0);
  }
}

// A set frozen by the version before keeps its text, its digest and its use, unless it has shapes of another
// window.
TEST(FrozenTable, OfTheFeaturesBeforeStaysWhatItWas) {
  auto csv = rooms().csv();
  const std::string now(nlos::k_feature_set_version), before(nlos::k_feature_set_before);
  for (auto at = csv.find(now); at != std::string::npos; at = csv.find(now))
    csv.replace(at, now.size(), before);
  const auto old = DatasetTable::parse(csv);
  ASSERT_TRUE(old) << old.error().message;
  EXPECT_EQ(old.value().csv(), csv);
  auto shapes = rooms();
  for (auto& row : shapes.rows) row.features.set(Feature::kurtosis, 9);
  shapes.feature_set = before;
  const auto refused = DatasetTable::parse(shapes.csv());
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().message.find("kurtosis"), std::string::npos) << refused.error().message;
}

TEST(FrozenTable, DigestChangesWithOneValueOneLabelAndTheSplit) {
  const auto digest = [](const FrozenDataset& set) { return dataset_digest(set.table.csv()); };
  const auto before = digest(frozen(Aggregation::none));
  EXPECT_EQ(digest(frozen(Aggregation::none)), before);
  EXPECT_NE(digest(frozen(Aggregation::none, {"room 1"})), before);
  auto moved = frozen(Aggregation::none), relabelled = moved;
  moved.table.rows[7].registers[0] += 1;
  relabelled.table.rows[3].los = !*relabelled.table.rows[3].los;
  EXPECT_NE(digest(moved), before);
  EXPECT_NE(digest(relabelled), before);
}

TEST(FrozenTable, TornTextNamesItsLine) {
  const auto csv = frozen(Aggregation::none).table.csv();
  EXPECT_EQ(DatasetTable::parse("range_m,los\n1,1\n").error().code, Errc::bad_frame);
  const auto torn = DatasetTable::parse(csv + "may,9\n");
  ASSERT_FALSE(torn);
  EXPECT_NE(torn.error().message.find("line 38"), std::string::npos) << torn.error().message;
  auto typo = csv;
  typo.replace(typo.find("rx_dbm"), 6, "rx_dmb");
  EXPECT_NE(DatasetTable::parse(typo).error().message.find("rx_dmb"), std::string::npos);
}

TEST(FrozenTable, RefusesToHoldOutEverythingOrAPlaceThatIsNotThere) {
  FreezeOptions options;
  options.test = {"attic"};
  EXPECT_EQ(freeze_rows(rooms(), options, {}).error().code, Errc::not_found);
  options.test = {"room 0", "room 1", "room 2"};
  EXPECT_EQ(freeze_rows(rooms(), options, {}).error().code, Errc::too_few_observations);
}

TEST(FrozenTable, RegistersTrainWhereTheyAreNamedAndOnlyThere) {
  const auto table = frozen(Aggregation::none).table;
  auto wish = wish_of(ml::Task::nlos_id, table);
  EXPECT_EQ(learning_rows(table, wish).value().data.features,
            (std::vector<std::string>{"range_m", "rx_dbm"}));
  wish.features = {"rx_dbm", "fp_amp1"};
  const auto rows = learning_rows(table, wish);
  ASSERT_TRUE(rows) << rows.error().message;
  EXPECT_EQ(rows.value().data.row(1)[1], 9001);
  wish.features = {"grp7"};
  EXPECT_EQ(learning_rows(table, wish).error().code, Errc::not_found);
}

}  // namespace anchord::api::frozen_table_test
