// Trains on the public data sets beside the checkout by the protocols of their README and prints one table
// against its figures. A figure that is not reached says so in the table. The assertions hold what is reached
// with margin; they are no claim to more.
#include <gtest/gtest.h>

#include <cctype>
#include <cstdio>
#include <filesystem>
#include <sstream>

#include "api/formats/labelled_table.hpp"
#include "api/learning/labelled_dataset.hpp"
#include "core/ml/learn.hpp"
#include "tests/paths.hpp"

namespace anchord::api::real_sets_test {
namespace {

const std::filesystem::path k_data = ANCHORD_SHARED_DATA;

struct Case {
  const char* name;
  const char* file;  // several with blanks between: each is a place
  std::vector<std::string> group_by;
  std::size_t folds;
  ml::Task task;
  double bar, bar_fpr;  // best plain figure of the set's README: accuracy and FPR, or MAE in metres
  double least,
      most_fpr;  // asserted: accuracy at least and FPR at most; or MAE at most `least` times the raw one
  const char* los_value{""};  // of a class that does not say it by its name
};

void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

class RealSet : public ::testing::TestWithParam<Case> {};

TEST_P(RealSet, HoldsItsFigureOnPlacesItHasNotSeen) {
  const Case& c = GetParam();
  std::vector<std::filesystem::path> paths;
  std::istringstream files{c.file};
  for (std::string file; files >> file;) paths.push_back(k_data / file);
  if (!std::filesystem::exists(paths.front()))
    GTEST_SKIP() << "REAL DATA ABSENT: " << paths.front()
                 << " is not beside the checkout; nothing was proven here";
  TableOptions options;
  options.group_by = c.group_by;
  options.los_value = c.los_value;
  const auto table = read_labelled_tables(paths, options);
  ASSERT_TRUE(table) << table.error().message;
  const bool identify = c.task == ml::Task::nlos_id;
  std::vector<std::size_t> rows;
  Dropped dropped;
  std::map<std::string, std::size_t> lacking;
  auto data = dataset_from(
      table.value(),
      {available_features(table.value(), identify, lacking), table.value().labelled(), !identify}, rows,
      dropped);
  ASSERT_TRUE(data) << data.error().message;
  if (c.task == ml::Task::los_bias || c.task == ml::Task::nlos_bias)
    data = data.value().of_class(c.task == ml::Task::los_bias);
  ml::LearnOptions how;
  how.task = c.task;
  how.folds = c.folds;
  how.run.threads = 0;
  const auto learned = ml::learn(data.value(), how);
  ASSERT_TRUE(learned) << learned.error().message;
  const auto& l = learned.value();

  if (identify) {
    const auto confusion = ml::confusion_at(l.p_los, data.value().los, l.model.classifier->threshold);
    std::printf("| %-20s | accuracy %.3f (plain %.3f: %s) | FPR %.3f (plain %.3f: %s) | %s\n", c.name,
                confusion.accuracy(), c.bar, confusion.accuracy() >= c.bar ? "reached" : "NOT REACHED",
                confusion.fpr(), c.bar_fpr, confusion.fpr() <= c.bar_fpr ? "reached" : "NOT REACHED",
                l.model.info.method.c_str());
    EXPECT_GE(confusion.accuracy(), c.least);
    EXPECT_LE(confusion.fpr(), c.most_fpr);
    return;
  }
  std::vector<double> left;
  for (std::size_t i = 0; i < data.value().rows(); ++i)
    left.push_back(data.value().bias_m[i] - l.correction_m[i]);
  const double raw = ml::error_stats(data.value().bias_m).mae_m, corrected = ml::error_stats(left).mae_m;
  const double harm = ml::worst_harm_m(data.value(), l.correction_m);
  std::printf(
      "| %-20s | MAE raw %.3f m, corrected %.3f m (plain %.3f: %s) | worst place %+.3f m (at most 0.02: %s) "
      "| NLL %.2f (constants %.2f) | %s\n",
      c.name, raw, corrected, c.bar, corrected <= c.bar ? "reached" : "NOT REACHED", harm,
      harm <= 0.02 ? "reached" : "NOT REACHED", l.nll, l.nll_constants, l.model.info.method.c_str());
  EXPECT_LE(corrected, c.least * raw);
  if (c.task == ml::Task::bias) {
    EXPECT_LE(harm, 0.02);
  }
  if (table.value().labelled()) {  // else a constant may be all that can be learned
    EXPECT_LT(l.nll, l.nll_constants);
  }
}

using enum ml::Task;
INSTANTIATE_TEST_SUITE_P(
    Public, RealSet,
    ::testing::Values(
        Case{"graz-rooms", "graz-rooms/rooms.csv.gz", {"room_to"}, 10, nlos_id, 0.860, 0.216, 0.855, 0.23},
        Case{"ghent-iiot", "ghent-iiot/iiot19.csv.gz", {"tag_pos"}, 10, nlos_id, 0.890, 0.071, 0.87, 0.08},
        Case{"warsaw-cir", "warsaw-cir/rangings.csv.gz", {"setup"}, 23, nlos_id, 0.885, 0.074, 0.88, 0.09},
        Case{"ewine-features", "ewine-features/features.csv.gz", {}, 3, nlos_id, 0.913, 0.098, 0.913, 0.105},
        Case{"bielefeld-mp", "bielefeld-mp/features.csv.gz", {}, 3, nlos_id, 0.930, 0.065, 0.922, 0.07, "1"},
        // The README's raw MAE of graz and ghent is of another sampling of rows; its plain figures are scaled
        // to ours.
        Case{"graz-rooms bias",
             "graz-rooms/rooms.csv.gz",
             {"room_to"},
             10,
             bias,
             0.491 * 0.278 / 0.329,
             0,
             0.85,
             0},
        Case{"ghent-iiot bias",
             "ghent-iiot/iiot19.csv.gz",
             {"tag_pos"},
             10,
             bias,
             0.200 * 0.227 / 0.246,
             0,
             1.0,
             0},
        Case{"warsaw-cir bias",
             "warsaw-cir/rangings.csv.gz",
             {"setup"},
             23,
             bias,
             0.65 * 0.216 / 0.510,
             0,
             0.5,
             0},
        // Its plain figure is of headings that are kept back; here one flight of three is, without levels or
        // labels. Both circles keep 10 m, so the range alone tells much of its own error: a flattered figure,
        // of which only the harm is worth holding (a constant of the other flights leaves 0.18 m).
        Case{"ctu-drone-pair",
             "ctu-drone-pair/line.csv.gz ctu-drone-pair/theta_0.csv.gz ctu-drone-pair/theta_180.csv.gz",
             {},
             3,
             bias,
             0.118,
             0,
             1.0,
             0},
        Case{"outdoor-static LOS",
             "outdoor-static/static.csv.gz",
             {"anchor_height_m"},
             7,
             los_bias,
             0.030,
             0,
             0.25,
             0},
        Case{"outdoor-static NLOS",
             "outdoor-static/static.csv.gz",
             {"anchor_height_m"},
             7,
             nlos_bias,
             0.035,
             0,
             0.25,
             0}),
    [](const auto& shown) {
      std::string name = shown.param.name;
      for (char& ch : name) ch = std::isalnum(static_cast<unsigned char>(ch)) != 0 ? ch : '_';
      return name;
    });

}  // namespace
}  // namespace anchord::api::real_sets_test
