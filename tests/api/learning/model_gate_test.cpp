// What lets one model take over from another.
#include "api/learning/model_gate.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

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

/// P(LOS) by the first-path level alone, rising with it where `slope` is positive.
ml::Model identification(double slope, double balanced_accuracy) {
  ml::Model m;
  m.info.task = ml::Task::nlos_id;
  m.info.features = {"fp_dbm"};
  m.info.data_digest = "a";
  m.info.metrics = {{"balanced_accuracy", balanced_accuracy}, {"fpr", 1 - balanced_accuracy}};
  m.classifier.emplace();
  m.classifier->scaler = {{-85.0}, {5.0}, 0};
  m.classifier->members = {{ml::Linear{{slope}, 0}}};
  return m;
}
/// NLOS ranges are 10 dB weaker; `n_los` and `n_nlos` of them.
DatasetTable weaker_behind_walls(std::size_t n_los, std::size_t n_nlos) {
  auto out = long_by(0.1, n_los + n_nlos, 1);
  for (std::size_t i = 0; i < out.rows.size(); ++i) {
    out.rows[i].los = i < n_los;
    out.rows[i].features.set(Feature::fp_dbm, i < n_los ? -80 : -90);
  }
  return out;
}

TEST(ModelGate, RefusesAnIdentificationOfItsOwnThatIsWrongMoreOftenThanACoin) {
  const auto rows = weaker_behind_walls(15, 15);
  const GateData data{{{&rows, "held_out", 10}}, true};
  EXPECT_TRUE(gate_of(identification(4, 0.99), nullptr, data).passed);
  const auto inverted = gate_of(identification(-4, 0.99), nullptr, data);
  EXPECT_FALSE(inverted.passed);
  EXPECT_NE(inverted.why.find("balanced accuracy 0.0000 is no better than chance"), std::string::npos)
      << inverted.why;
  const auto lucky = gate_of(identification(4, 0.4), nullptr, data);
  EXPECT_FALSE(lucky.passed) << "its own cross-validation says so";
  EXPECT_NE(lucky.why.find("0.4000 in cross-validation"), std::string::npos) << lucky.why;
}

// Calls everything NLOS but one range in twelve: never wrong about NLOS, and of no use.
TEST(ModelGate, RefusesAnIdentificationThatGivesUpWhatTheActiveOneKnows) {
  auto rows = weaker_behind_walls(24, 12);
  rows.rows[0].features.set(Feature::fp_dbm, -60);
  rows.rows[1].features.set(Feature::fp_dbm, -60);
  auto timid = identification(4, 0.6);
  timid.classifier->offset = -15;
  const auto active = identification(4, 0.99);
  const auto report = gate_of(timid, &active, {{{&rows, "held_out", 10}}, true});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("of always predicting the same class"), std::string::npos) << report.why;
}

TEST(ModelGate, AnEasyHeldOutPartDoesNotHideWhatCrossValidationSays) {
  const auto rows = long_by_ten_centimetres(20, 1);
  const auto report = gate_of(correction(0.1, "a", 0.35), nullptr, {{{&rows, "held_out", 10}}, true});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("MAE 0.3500 m in cross-validation is no better than the 0.2000 m"),
            std::string::npos)
      << report.why;
}

TEST(ModelGate, RowsOfTheTrainingPartJudgeNobodyUnderAnotherName) {
  auto both = long_by_ten_centimetres(20, 1);
  auto trained = long_by(0.10, 15, 1, false);
  for (auto& row : trained.rows) row.environment = "another room";
  both.rows.insert(both.rows.end(), trained.rows.begin(), trained.rows.end());
  EXPECT_EQ(gate_of(correction(0.09, "a", 0.03), nullptr, {{{&both, "held_out", 5}}, true}).checks[0].basis,
            "held_out");
  EXPECT_EQ(gate_of(correction(0.09, "a", 0.03), nullptr, {{{&both, "held_out", 6}}, true}).checks[0].basis,
            "manifest");
}

TEST(ModelGate, RefusesACorrectionWhoseSigmaIsFarTooSmall) {
  const auto rows = long_by_ten_centimetres(20, 1);
  auto candidate = correction(0.09, "a", 0.03);
  candidate.regressor->sigma_m = 0.01;
  EXPECT_TRUE(gate_of(candidate, nullptr, {{{&rows, "kept_data", 10}}, false}).passed);
  candidate.regressor->sigma_m = 1e-4;
  const auto report = gate_of(candidate, nullptr, {{{&rows, "kept_data", 10}}, false});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("only 0.0000 of the errors are within 1.96 of the sigmas"), std::string::npos)
      << report.why;
}

// NLOS ranges are 0.6 m late and LOS ones 0.1 m: a correction by the class halves nothing if the classes are
// exchanged.
TEST(ModelGate, RefusesAnIdentificationThatMakesTheActiveCorrectionsWorse) {
  auto rows = weaker_behind_walls(20, 20);
  for (auto& row : rows.rows) row.features.set(Feature::range_m, *row.true_range_m + (*row.los ? 0.1 : 0.6));
  auto los = correction(0.1, "l", 0.02), nlos = correction(0.6, "n", 0.02);
  nlos.info.task = ml::Task::nlos_bias;
  for (auto* model : {&los, &nlos}) model->regressor->scaler = {{20.0}, {20.0}, 0};  // the ranges are not far
  const auto right = identification(4, 0.99);
  GateData data{{{&rows, "held_out", 10}}, true};
  data.beside.nlos_id = std::make_shared<const ml::Model>(right);
  data.beside.los_bias = std::make_shared<const ml::Model>(los);
  data.beside.nlos_bias = std::make_shared<const ml::Model>(nlos);
  const auto together = [](const GateReport& report) {
    const auto at = std::ranges::find(report.checks, "with_corrections", &GateCheck::name);
    return at == report.checks.end() ? nullptr : &*at;
  };
  const auto same = gate_of(right, nullptr, data);
  ASSERT_NE(together(same), nullptr);
  EXPECT_TRUE(same.passed) << same.why;
  const auto exchanged = gate_of(identification(-4, 0.99), nullptr, data);
  ASSERT_NE(together(exchanged), nullptr);
  EXPECT_FALSE(together(exchanged)->passed);
  EXPECT_GT(*together(exchanged)->candidate, 0.4);
  EXPECT_LT(*together(exchanged)->current, 0.05);
}

// The places of the active model, learned by heart: what the candidate has seen tells nothing of it.
TEST(ModelGate, OnThePlacesOfTheActiveModelTheCandidatesOwnTrainingRowsDoNotCount) {
  const auto home = long_by_ten_centimetres(20, 1);
  auto own = long_by(0.10, 20, 1, false);
  const auto fresh = long_by(0.10, 15, 1);
  own.rows.insert(own.rows.end(), fresh.rows.begin(), fresh.rows.end());
  for (std::size_t i = 20; i < own.rows.size(); ++i)
    own.rows[i].features.set(Feature::range_m, own.rows[i].range_m() + 0.001);
  const auto active = correction(0.08, "home", 0.02);
  const auto report = gate_of(correction(0.10, "own", 0.01), &active,
                              {{{&own, "held_out", 10}}, true, &own, {true, &home, true}});
  EXPECT_FALSE(report.passed);
  EXPECT_NE(report.why.find("nothing shows how it does on the places of the active model"), std::string::npos)
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
