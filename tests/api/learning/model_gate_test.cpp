// What lets one model take over from another.
#include "api/learning/model_gate.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "api/learning/model_registry.hpp"
#include "api/learning/range_features.hpp"

namespace anchord::api::model_gate_test {
namespace {

using nlos::Feature;

/// A correction of all LOS ranges by `bias_m`, as trained on the data of this digest.
ml::Model correction(double bias_m, const std::string& digest, double claimed_mae_m) {
  ml::Model m;
  m.info.task = ml::Task::los_bias;
  m.info.features = {"range_m"};
  m.info.data_digest = digest;
  m.info.rows = 100, m.info.folds = 5, m.info.seed = 1, m.info.group_by = "environment";
  m.info.metrics = {{"mae_raw_m", 0.2}, {"mae_m", claimed_mae_m}};
  m.regressor.emplace();
  m.regressor->scaler = {{0.0}, {1.0}, 0};
  m.regressor->scorer = ml::Linear{{0.0}, bias_m};
  m.regressor->fallback_m = bias_m;
  return m;
}

/// LOS ranges `bias_m` too long, each a row that stands for `repeats` rangings.
DatasetTable long_by(double bias_m, std::size_t n, std::size_t repeats, bool test = true) {
  DatasetTable out;
  for (std::size_t i = 0; i < n; ++i) {
    DatasetRow row;
    row.campaign = "c", row.environment = "room", row.setting = "s" + std::to_string(i);
    row.test = test, row.los = true, row.repeats = repeats;
    row.true_range_m = 3.0 + static_cast<double>(i);
    row.features.set(Feature::range_m, *row.true_range_m + bias_m);
    if (i % 2 == 0) row.features.set(Feature::fp_dbm, -80);
    out.rows.push_back(std::move(row));
  }
  return out;
}
DatasetTable long_by_ten_centimetres(std::size_t n, std::size_t repeats) { return long_by(0.10, n, repeats); }

const GateCheck* check_on(const GateReport& report, const std::string& basis) {
  const auto at = std::ranges::find(report.checks, basis, &GateCheck::basis);
  return at == report.checks.end() ? nullptr : &*at;
}

}  // namespace

// A range with everything a flight can bring has every feature models may be promoted with, and no other.
TEST(RangeFeatures, OfARangeAreThoseThatModelsMayAskFor) {
  Range range;
  range.distance_m = 5, range.rx_dbm = -80, range.fp_dbm = -83, range.std_noise = 40, range.heading_deg = 10;
  range.cir.emplace();
  range.cir->first_path_idx = 74.4, range.cir->preamble_count = 1000;
  for (int k = 0; k < 128; ++k)
    range.cir->re_im.insert(range.cir->re_im.end(),
                            {static_cast<std::int16_t>(k < 74 ? 30 : 5000 - 40 * k), 0});
  const auto features = features_of(range);
  for (std::size_t f = 0; f < nlos::k_feature_count; ++f)
    EXPECT_EQ(features.present.test(f), nlos::live_ranges_have(static_cast<Feature>(f)))
        << nlos::feature_name(static_cast<Feature>(f));
}

// What a flight gets of a model that is 20 m wrong: the reason, and nothing to take off.
TEST(RangeFeatures, ARangeOfAFlightIsToldThatItsCorrectionIsWithheld) {
  auto good = correction(0.1, "a", 0.01), wrong = correction(20, "b", 0.01);
  good.info.task = wrong.info.task = ml::Task::bias;
  Range range;
  range.distance_m = 2;
  const auto of = [&](ml::Model model) {
    std::vector<ml::Model> models;
    models.push_back(std::move(model));
    return predict_range(models_together(std::move(models), ml::Correction::weighted).value(), range);
  };
  const auto applied = of(good), kept = of(wrong);
  ASSERT_TRUE(applied && kept);
  EXPECT_EQ(applied->bias_m, 0.1);
  EXPECT_EQ(applied->withheld, "");
  EXPECT_FALSE(kept->bias_m);
  EXPECT_EQ(kept->withheld, ml::why_withheld(ml::Withheld::implausible));
}

// The one trained on means claims 1 cm of its means and is 9 cm off on ranges.
TEST(ModelGate, MeasuresBothOnTheSameSingleRangesWhateverTheyClaim) {
  const auto rows = long_by_ten_centimetres(20, 1);
  const auto honest = correction(0.09, "a", 0.03), means = correction(0.01, "b", 0.01);
  const GateData data{{{&rows, "held_out", 1}}, true};
  const auto report = gate_of(honest, &means, data);
  EXPECT_TRUE(report.passed) << report.why;
  EXPECT_NEAR(*report.checks[0].candidate, 0.01, 1e-9);
  EXPECT_NEAR(*report.checks[0].current, 0.09, 1e-9);
  EXPECT_FALSE(gate_of(means, &honest, data).passed);
}

TEST(ModelGate, RowsThatAreMeansJudgeNobody) {
  const auto means = long_by_ten_centimetres(20, 5);
  const auto report = gate_of(correction(0.09, "a", 0.03), nullptr, {{{&means, "kept_data", 1}}, false});
  EXPECT_FALSE(report.passed);
  EXPECT_EQ(report.checks[0].basis, "none");
}

TEST(ModelGate, TakesOnlyRowsThatHaveTheFeaturesOfBoth) {
  const auto rows = long_by_ten_centimetres(20, 1);  // ten have a first-path level
  auto needs_level = correction(0.02, "b", 0.01);
  needs_level.info.features = {"range_m", "fp_dbm"};
  needs_level.regressor->scaler = {{0.0, 0.0}, {1.0, 1.0}, 0};
  needs_level.regressor->scorer = ml::Linear{{0.0, 0.0}, 0.02};
  const auto honest = correction(0.09, "a", 0.03);
  EXPECT_TRUE(gate_of(honest, &needs_level, {{{&rows, "kept_data", 10}}, false}).passed);
  EXPECT_EQ(gate_of(honest, &needs_level, {{{&rows, "kept_data", 11}}, false}).checks[0].basis, "none");
}

TEST(ModelGate, FiguresOfDifferentRowsAreNotCompared) {
  const auto older = correction(0.09, "a", 0.05), newer = correction(0.09, "b", 0.01);
  const auto report = gate_of(newer, &older, {{}, true});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("to compare it with the active model"), std::string::npos) << report.why;
  EXPECT_FALSE(report.checks[1].current) << "a figure of other rows stands beside it";
  // The same rows and folds can.
  EXPECT_TRUE(gate_of(correction(0.09, "a", 0.01), &older, {{}, true}).passed);
  EXPECT_FALSE(gate_of(correction(0.09, "a", 0.06), &older, {{}, true}).passed);
}

// In the odd room every range is 0.60 m too long: whoever learned there is right there, and half a metre off
// at home.
TEST(ModelGate, RefusesACandidateThatIsWorseOnThePlacesOfTheActiveModel) {
  const auto odd = long_by(0.60, 20, 1), home = long_by_ten_centimetres(20, 1);
  const auto candidate = correction(0.60, "odd", 0.01), active = correction(0.09, "home", 0.02);
  GateData data{{{&odd, "held_out", 1}}, true, &odd, {true, &home, true}};
  const auto report = gate_of(candidate, &active, data);
  EXPECT_FALSE(report.passed);
  const auto* there = check_on(report, "active_places");
  ASSERT_NE(there, nullptr) << report.why;
  EXPECT_NEAR(*there->candidate, 0.50, 1e-9);
  EXPECT_NEAR(*there->current, 0.01, 1e-9);
  EXPECT_NE(
      report.why.find("0.5000 is worse than the 0.0100 of the active model on the places of the active"),
      std::string::npos)
      << report.why;
  EXPECT_TRUE(gate_of(correction(0.10, "odd too", 0.01), &active,
                      {{{&home, "held_out", 1}}, true, nullptr, {true, &home, true}})
                  .passed);
}

// Nothing was held out there: the rows the active one learned from, against its out-of-fold figure.
TEST(ModelGate, TakesTheActiveModelsOutOfFoldFiguresWhereItHeldNothingOut) {
  const auto odd = long_by(0.60, 20, 1), home = long_by(0.10, 20, 1, false);
  const auto active = correction(0.09, "home", 0.02);
  const auto report = gate_of(correction(0.60, "odd", 0.01), &active,
                              {{{&odd, "held_out", 1}}, true, nullptr, {true, &home, true}});
  const auto* there = check_on(report, "active_places");
  ASSERT_NE(there, nullptr) << report.why;
  EXPECT_FALSE(there->passed);
  EXPECT_NEAR(*there->candidate, 0.50, 1e-9);
  EXPECT_EQ(*there->current, 0.02) << "what its manifest says of these rows";
}

TEST(ModelGate, SaysWhereNothingTellsHowACandidateDoesOnThePlacesOfTheActiveModel) {
  const auto rows = long_by_ten_centimetres(20, 1);
  const auto active = correction(0.08, "home", 0.02);
  const auto report = gate_of(correction(0.10, "a", 0.01), &active,
                              {{{&rows, "held_out", 1}}, true, nullptr, {true, nullptr, true}});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("the data that one was trained on are not kept here"), std::string::npos)
      << report.why;
}

// Light takes 3.3356 ns for a metre.
TEST(ModelGate, RefusesAModelOfRangesInNanoseconds) {
  auto nanoseconds = long_by(0, 20, 1);
  for (auto& row : nanoseconds.rows) row.features.set(Feature::range_m, *row.true_range_m * 3.3356 + 0.1);
  const auto report = gate_of(correction(9.0, "ns", 0.01), nullptr,
                              {{{&nanoseconds, "held_out", 1}}, true, &nanoseconds, {}});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("20 of the 20 rows it was trained on are no ranges of a radio in metres"),
            std::string::npos)
      << report.why;
  // So is one that says of itself what no radio does, wherever it comes from.
  const auto far = long_by(30, 20, 1);
  const auto claims = gate_of(correction(30, "b", 0.01), nullptr, {{{&far, "kept_data", 1}}, false});
  EXPECT_FALSE(claims.passed);
  EXPECT_NE(claims.why.find("its usual correction is 30.0000 m"), std::string::npos) << claims.why;
}

}  // namespace anchord::api::model_gate_test
