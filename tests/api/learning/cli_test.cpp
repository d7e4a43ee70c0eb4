// The learning commands as a user runs them: the real binary, files on disk, exit codes and streams.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "tests/paths.hpp"

namespace anchord::cli_test {
namespace {

struct Ran {
  int code;
  std::string out, err;
};

class LearningCli : public ::testing::Test {
 protected:
  void SetUp() override {
    dir_ = std::filesystem::temp_directory_path() /
           ("anchord_cli_" + std::to_string(getpid()) + "_" +
            ::testing::UnitTest::GetInstance()->current_test_info()->name());
    std::filesystem::create_directories(dir_);
    // Forty-eight placements in six rooms; walls weaken the first path and delay it by 0.3 to 0.8 m.
    std::ofstream rooms{dir_ / "rooms.csv"};
    rooms << "env,nlos,setup_id,range_m,true_range_m,rx_dbm,fp_dbm,note\n";
    for (int p = 0; p < 48; ++p) {
      const bool nlos = p % 2 == 1;
      for (int k = 0; k < 4; ++k) {
        const double truth = 2 + (p * 7 % 17) * 0.5, wobble = 0.01 * ((p * 31 + k * 17) % 7 - 3);
        const double rx = -74 - 20 * std::log10(truth) - (nlos ? 4 : 0) + 20 * wobble;
        rooms << "room" << p / 8 << ',' << nlos << ",s" << p << ','
              << truth + 0.1 + wobble + (nlos ? 0.3 + 0.1 * (p % 6) : 0) << ',' << truth << ',' << rx << ','
              << rx - (nlos ? 7 : 2) - 10 * wobble << ",x\n";
      }
    }
  }
  void TearDown() override { std::filesystem::remove_all(dir_); }

  static std::string slurp(const std::filesystem::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
  }
  Ran run(const std::string& arguments, const std::string& before = "") const {
    const std::string command = "cd '" + dir_.string() + "' && " + before + "'" ANCHORD_BINARY "' " +
                                arguments + " >out.txt 2>err.txt";
    const int status = std::system(command.c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, slurp(dir_ / "out.txt"), slurp(dir_ / "err.txt")};
  }

  std::filesystem::path dir_;
};

}  // namespace

TEST_F(LearningCli, TrainsAndEvaluatesWithJsonAloneOnStandardOutput) {
  const auto train = run(
      "train --data rooms.csv --task nlos_id --label nlos --group-by env --method auto --out m.json --json");
  ASSERT_EQ(train.code, 0) << train.err;
  const auto report = nlohmann::json::parse(train.out);
  EXPECT_EQ(report.at("places"), 6);
  EXPECT_EQ(report.at("placements"), 48);
  const auto evaluate = run("evaluate --model m.json --data rooms.csv --json");
  ASSERT_EQ(evaluate.code, 0) << evaluate.err;
  const auto e = nlohmann::json::parse(evaluate.out);
  for (const char* key : {"accuracy", "balanced_accuracy", "fpr", "fnr", "brier", "confusion"})
    EXPECT_TRUE(e.contains(key)) << key;
  EXPECT_GT(e.at("accuracy"), 0.95);
  EXPECT_EQ(e.at("n"), 192);
}

TEST_F(LearningCli, BiasIsReportedRawAndCorrectedPerClassAndOverAll) {
  ASSERT_EQ(run("train --data rooms.csv --task bias --truth true_range_m --group-by env --out m.json").code,
            0);
  const auto e = nlohmann::json::parse(run("evaluate --model m.json --data rooms.csv --json").out);
  EXPECT_LT(e.at("mae_m"), e.at("mae_raw_m"));
  for (const char* which : {"all", "los", "nlos"})
    for (const char* key : {"mae_raw_m", "mae_m", "mse_raw_m2", "mse_m2"})
      EXPECT_TRUE(e.at("bias").at(which).contains(key)) << which << ' ' << key;
}

TEST_F(LearningCli, TheSameSeedWritesTheSameBytes) {
  ASSERT_EQ(run("train --data rooms.csv --task bias --out a.json --seed 5").code, 0);
  ASSERT_EQ(run("train --data rooms.csv --task bias --out b.json --seed 5").code, 0);
  EXPECT_FALSE(slurp(dir_ / "a.json").empty());
  EXPECT_EQ(slurp(dir_ / "a.json"), slurp(dir_ / "b.json"));
}

// Folds and trees go to threads as they come free: nothing of that may show.
TEST_F(LearningCli, ThreadsAndCoresDoNotChangeAByteOfTheModel) {
  const std::string grid =
      " --seed 3 --folds 4 --try svm.c=1,3 --try random_forest.leaf_share=0.02,0.08 --try "
      "boosted.rounds=20,40";
  const std::vector<std::string> runs{
      "--task nlos_id --method logistic,svm,random_forest,boosted,average,tree_average" + grid, "--task bias",
      "--task nlos_bias --method polynomial,multivariate,least_absolute,svm,random_forest,boosted" + grid};
  for (const auto& one : runs) {
    std::string first;
    for (const char* threads : {"1", "2", "5", "0"}) {
      ASSERT_EQ(run("train --data rooms.csv --out t.json " + one + " --threads " + threads).code, 0)
          << slurp(dir_ / "err.txt");
      const auto bytes = slurp(dir_ / "t.json");
      if (first.empty()) first = bytes;
      EXPECT_EQ(bytes, first) << one << ", " << threads << " threads";
    }
    // One core, as many threads as the machine would have.
    ASSERT_EQ(run("train --data rooms.csv --out t.json " + one + " --threads 4", "taskset -c 0 ").code, 0);
    EXPECT_EQ(slurp(dir_ / "t.json"), first) << one;
  }
}

TEST_F(LearningCli, AFrozenDataSetIsTheSameFileEachTimeAndTrainsWithItsOwnSplit) {
  ASSERT_EQ(run("dataset build --data rooms.csv --hold-out room5 --aggregate none --out set.csv").code, 0)
      << slurp(dir_ / "err.txt");
  const auto made = slurp(dir_ / "out.txt");
  ASSERT_EQ(run("dataset check set.csv").code, 0);
  const auto digest = made.substr(7, 64);
  EXPECT_EQ(slurp(dir_ / "out.txt").substr(7, 64), digest);
  // The digest is that of the file, which other tools can take too.
  ASSERT_EQ(std::system(("cd '" + dir_.string() + "' && sha256sum set.csv | grep -q ^" + digest).c_str()), 0);
  std::filesystem::create_directories(dir_ / "elsewhere");
  std::filesystem::copy(dir_ / "rooms.csv", dir_ / "elsewhere/rooms.csv");
  ASSERT_EQ(
      run("dataset build --data elsewhere/rooms.csv --hold-out room5 --aggregate none --out b.csv").code, 0);
  EXPECT_EQ(slurp(dir_ / "b.csv"), slurp(dir_ / "set.csv"));
  EXPECT_EQ(run("dataset check set.csv --digest " + digest).code, 0);
  EXPECT_EQ(run("dataset check set.csv --digest 00").code, 2);
  EXPECT_EQ(run("dataset check rooms.csv").code, 2);

  const auto train = run("train --data set.csv --method logistic --folds 4 --out m.json --json");
  ASSERT_EQ(train.code, 0) << train.err;
  const auto model = nlohmann::json::parse(slurp(dir_ / "m.json"));
  EXPECT_EQ(model.at("manifest").at("data").at("digest"), digest) << model.at("manifest");
  const auto evaluate = run("evaluate --model m.json --data set.csv --json");
  ASSERT_EQ(evaluate.code, 0) << evaluate.err;
  EXPECT_EQ(nlohmann::json::parse(evaluate.out).at("n"), 192);
}

TEST_F(LearningCli, SaysBeforehandWhichMethodsCanDoATaskAndWhatIsTooMuch) {
  const auto bias = run("train --data rooms.csv --task bias --method logistic --out m.json");
  EXPECT_EQ(bias.code, 2);
  EXPECT_NE(bias.err.find("logistic cannot learn bias"), std::string::npos) << bias.err;
  EXPECT_NE(bias.err.find("multivariate"), std::string::npos) << bias.err;
  EXPECT_EQ(run("train --data rooms.csv --task nlos_id --method constant --out m.json").code, 2);
  std::string many;
  for (int i = 1; i <= 100; ++i) many += (i > 1 ? "," : "") + std::to_string(i);
  const auto much =
      run("train --data rooms.csv --method random_forest --folds 1000 --try random_forest.trees=" + many +
          " --try random_forest.leaf_share=" + many + " --out m.json");
  EXPECT_EQ(much.code, 2);
  EXPECT_NE(much.err.find("10000 settings x 1000 folds on 192 rows"), std::string::npos) << much.err;
}

TEST_F(LearningCli, UnusableInputExitsWithTwoNamesItAndLeavesNoModel) {
  std::ofstream{dir_ / "torn.csv"} << "nlos,range_m\n0,1\n1\n";
  const auto torn = run("train --data torn.csv --out m.json --json");
  EXPECT_EQ(torn.code, 2);
  EXPECT_TRUE(torn.out.empty());
  EXPECT_NE(torn.err.find("torn.csv:3"), std::string::npos) << torn.err;
  const auto column = run("train --data rooms.csv --label wall --out m.json");
  EXPECT_EQ(column.code, 2);
  EXPECT_NE(column.err.find("no column wall"), std::string::npos) << column.err;
  EXPECT_EQ(run("train --data absent.csv --out m.json").code, 2);
  EXPECT_EQ(run("train --data rooms.csv --task colour --out m.json").code, 2);
  EXPECT_EQ(run("train --data rooms.csv --method magic --out m.json").code, 2);
  EXPECT_EQ(run("train --data rooms.csv --features nothing --out m.json").code, 2);
  EXPECT_FALSE(std::filesystem::exists(dir_ / "m.json"));
  std::ofstream{dir_ / "bad.json"} << "{\"format\":\"anchord-model-1\"}";
  const auto model = run("evaluate --model bad.json --data rooms.csv");
  EXPECT_EQ(model.code, 2);
  EXPECT_NE(model.err.find("/manifest"), std::string::npos) << model.err;
}

TEST_F(LearningCli, SaysWhatOfATableItDoesNotUse) {
  const auto plain = run("train --data rooms.csv --task nlos_id --method logistic --out m.json");
  ASSERT_EQ(plain.code, 0) << plain.err;
  EXPECT_NE(plain.out.find("columns not used: note"), std::string::npos) << plain.out;
  const auto json = nlohmann::json::parse(
      run("train --data rooms.csv --task nlos_id --method logistic --out m.json --json").out);
  EXPECT_EQ(json.at("data").at("columns").at("unused"), nlohmann::json{"note"}) << json;
}

TEST_F(LearningCli, AModelThatItsReaderWouldRefuseIsNotWritten) {
  std::string name(200, 'x'), csv = slurp(dir_ / "rooms.csv");
  csv.replace(csv.find("note"), 4, name);
  for (std::size_t at; (at = csv.find(",x\n")) != std::string::npos;) csv.replace(at, 3, ",7\n");
  std::ofstream{dir_ / "long.csv"} << csv;
  std::ofstream{dir_ / "m.json"} << "what was there";
  const auto refused =
      run("train --data long.csv --task nlos_id --method logistic --features rx_dbm,fp_dbm," + name +
          " --out m.json");
  EXPECT_EQ(refused.code, 2) << refused.out;
  EXPECT_NE(refused.err.find("could not be read again and is not kept"), std::string::npos) << refused.err;
  EXPECT_EQ(slurp(dir_ / "m.json"), "what was there");
}

}  // namespace anchord::cli_test
