#include "core/ml/training.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <thread>

#include "tests/core/ml/learning_world.hpp"

namespace anchord::ml::training_test {
namespace {

using std::chrono::steady_clock;

bool same_numbers(const TrainingOutcome& a, const TrainingOutcome& b) {
  if (a.predictions.size() != b.predictions.size() || a.importance.size() != b.importance.size())
    return false;
  for (std::size_t i = 0; i < a.predictions.size(); ++i)
    if (a.predictions[i].p_los != b.predictions[i].p_los ||
        a.predictions[i].correction_m != b.predictions[i].correction_m)
      return false;
  for (std::size_t i = 0; i < a.importance.size(); ++i)
    if (a.importance[i].feature != b.importance[i].feature || a.importance[i].mean != b.importance[i].mean)
      return false;
  return a.model.info.method == b.model.info.method && a.model.info.metrics == b.model.info.metrics;
}

}  // namespace

TEST(Training, SaysBeforehandThatASearchWouldTakeDaysAndThatAMethodCannotLearnTheTask) {
  TrainingSpec spec;
  spec.methods = {Method::random_forest};
  std::vector<double> values(100, 1);
  spec.grid = {{Method::random_forest, {{"trees", values}, {"leaf_share", values}}}};
  ASSERT_TRUE(spec.check());
  EXPECT_TRUE(spec.check_size(5'000));
  const auto much = spec.check_size(50'000);  // 10 000 settings x 10 folds x 50 000 rows
  ASSERT_FALSE(much);
  EXPECT_NE(much.error().message.find("10000 settings x 10 folds on 50000 rows"), std::string::npos)
      << much.error().message;
  // An SVM is fitted to a few thousand of them.
  spec.methods = {Method::svm};
  spec.grid = {{Method::svm, {{"c", values}, {"gamma", values}}}};
  EXPECT_TRUE(spec.check_size(500'000));
  spec.task = Task::bias, spec.methods = {Method::logistic}, spec.grid = {};
  const auto unable = spec.check();
  ASSERT_FALSE(unable);
  EXPECT_NE(
      unable.error().message.find("logistic cannot learn bias; the methods that can are none, constant"),
      std::string::npos)
      << unable.error().message;
}

TEST(Training, TellsOfHowManyRowsAnSvmWasFitted) {
  TrainingSpec spec;
  spec.methods = {Method::svm};
  spec.folds = 2, spec.importance = false;
  const auto few = train(learning_world(1, false), spec);
  ASSERT_TRUE(few);
  EXPECT_EQ(few.value().model.info.why.find("drawn evenly"), std::string::npos);
  const auto many = train(learning_world(1, false, 1000), spec);  // 1000 placements of 5 rows each
  ASSERT_TRUE(many);
  EXPECT_NE(many.value().model.info.why.find("fitted to 4000 of 5000 rows, drawn evenly"), std::string::npos)
      << many.value().model.info.why;
}

TEST(Training, ReportsGridFoldsImportanceAndPredictionsOfTheSameRun) {
  const auto data = learning_world(1, false);
  TrainingSpec spec;
  spec.methods = {Method::logistic, Method::random_forest};
  spec.grid = {{Method::logistic, {{"c", {0.1, 1, 10}}}},
               {Method::random_forest, {{"leaf_share", {0.02, 0.1}}}}};
  spec.folds = 3;
  spec.held_out = {"room 5"};
  spec.selection = true;
  const auto run = train(data, spec);
  ASSERT_TRUE(run) << run.error().message;
  const auto& o = run.value();
  EXPECT_EQ(o.candidates.size() % 5, 0U);  // 3 points of logistic and 2 of the forest for each feature set
  EXPECT_EQ(o.folds.size(), 3 * o.candidates.size());
  EXPECT_EQ(o.fold_places.size(), 3U);
  EXPECT_EQ(o.importance.size(), data.columns());
  EXPECT_EQ(o.predictions.size(), data.rows());
  EXPECT_EQ(o.split.train_rows, 400U);
  EXPECT_EQ(o.split.test_rows, 80U);
  EXPECT_EQ(o.split.test_place_names, std::vector<std::string>{"room 5"});
  EXPECT_FALSE(o.split.leak);
  ASSERT_TRUE(o.test);
  EXPECT_GT(o.test->confusion->accuracy(), 0.85);
  ASSERT_TRUE(o.threshold);
  EXPECT_LE(o.threshold->fpr_low, o.threshold->fpr);
  EXPECT_GE(o.threshold->fpr_high, o.threshold->fpr);
  EXPECT_FALSE(o.selection.empty());
  EXPECT_TRUE(o.selection.front().kept);
}

// One feature tells the classes apart, the other six are noise: the model is of what the filter keeps, and
// says so.
TEST(Training, AModelUsesTheFeaturesThatTheFilterKeeps) {
  Random random{5};
  Dataset data;
  data.features = {"a", "b", "c", "d", "e", "f", "g"};
  for (std::uint32_t i = 0; i < 400; ++i) {
    const bool los = i % 2 == 0;
    for (std::size_t c = 0; c < 7; ++c)
      data.x.push_back(random.uniform() - 0.5 + (c == 3 ? (los ? 0.3 : -0.3) : 0.0));
    data.los.push_back(los ? 1 : 0);
    data.weight.push_back(1);
    data.group.push_back(i % 8), data.placement.push_back(i);
  }
  TrainingSpec spec;
  spec.methods = {Method::logistic};
  spec.features = data.features;
  spec.folds = 4;
  spec.selection = true;
  const auto run = train(data, spec);
  ASSERT_TRUE(run) << run.error().message;
  const auto& info = run.value().model.info;
  std::vector<std::string> kept;
  for (const auto& step : run.value().selection)
    if (step.kept) kept.push_back(step.feature);
  EXPECT_EQ(kept.front(), "d");
  EXPECT_LT(kept.size(), 7U);
  EXPECT_EQ(info.features, kept) << info.why;
  EXPECT_NE(info.why.find("keeps " + std::to_string(kept.size()) + " of 7"), std::string::npos) << info.why;
  std::size_t picked = 0;
  for (const auto& row : run.value().candidates) picked += row.picked ? 1 : 0;
  EXPECT_EQ(picked, 1U);
}

TEST(Training, LeakReportFindsAPlacementInTwoPlacesAndCopiedRows) {
  auto data = learning_world(1, false);
  data.placement[100] = data.placement[0];  // rows 0 and 100 are of different places
  for (std::size_t c = 0; c < data.columns(); ++c) data.x[200 * data.columns() + c] = data.x[c];
  data.los[200] = data.los[0];
  const auto report = split_report(data, {0, 1, 2}, {200});
  EXPECT_EQ(report.shared_placements, 1U);
  EXPECT_EQ(report.duplicate_rows, 1U);
  EXPECT_TRUE(report.leak);
}

TEST(Training, OneSeedGivesTheSameNumbersOnAnyNumberOfThreads) {
  const auto data = learning_world(3, true);
  for (const Task task : {Task::nlos_id, Task::bias}) {
    TrainingSpec spec;
    spec.task = task;
    spec.threads = 1;
    const auto one = train(data, spec);
    spec.threads = 4;
    const auto four = train(data, spec);
    ASSERT_TRUE(one && four);
    EXPECT_TRUE(same_numbers(one.value(), four.value())) << task_name(task);
  }
}

TEST(Training, StopsSoonAfterItIsAskedTo) {
  const auto data = learning_world(1, true, 4000);  // 32 000 rows: minutes of work
  TrainingSpec spec;
  spec.methods = {Method::boosted, Method::svm, Method::random_forest};
  spec.search = true;
  spec.per_placement = 8;
  for (const Method method : spec.methods) {
    auto one = spec;
    one.methods = {method};
    std::stop_source stop;
    std::atomic<bool> searching{false};
    steady_clock::time_point asked;
    std::jthread asker{[&] {
      searching.wait(false);
      asked = steady_clock::now();
      stop.request_stop();
    }};
    const auto run = train(data, one, stop.get_token(), [&](const TrainingProgress& p) {
      if (p.stage == "search" && !searching.exchange(true)) searching.notify_all();
    });
    const auto ended = steady_clock::now();
    asker.join();
    ASSERT_FALSE(run);
    EXPECT_EQ(run.error().code, Errc::canceled);
    EXPECT_LT(std::chrono::duration<double>(ended - asked).count(), 5.0)  // 0.5 s on a quiet machine
        << method_name(method);
  }
}

TEST(Training, ProgressNeverFallsAndEndsAtOne) {
  double last = 0;
  std::string stage;
  const auto run = train(learning_world(1, true), {}, {}, [&](const TrainingProgress& p) {
    EXPECT_GE(p.fraction, last);
    last = p.fraction, stage = p.stage;
  });
  ASSERT_TRUE(run) << run.error().message;
  EXPECT_DOUBLE_EQ(last, 1.0);
  EXPECT_EQ(stage, "test");
}

TEST(Training, NamesEveryFaultOfASpec) {
  TrainingSpec spec;
  spec.folds = 1;
  spec.grid = {{Method::logistic, {{"gamma", {1}}}}};
  const auto checked = spec.check();
  ASSERT_FALSE(checked);
  EXPECT_NE(checked.error().message.find("folds"), std::string::npos);
  EXPECT_NE(checked.error().message.find("logistic has no setting gamma"), std::string::npos);
}

}  // namespace anchord::ml::training_test
