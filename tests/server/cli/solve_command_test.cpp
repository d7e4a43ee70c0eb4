// The real binary, as an operator calls it.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>

#include "tests/paths.hpp"

namespace {

namespace fs = std::filesystem;

struct Answer {
  int exit_code{};
  std::string out;
};

/// Standard output alone; standard error goes nowhere.
Answer run(const std::string& arguments) {
  Answer answer;
  FILE* pipe = popen((std::string("'") + ANCHORD_BINARY + "' " + arguments + " 2>/dev/null").c_str(), "r");
  if (!pipe) return {-1, ""};
  std::array<char, 4096> chunk{};
  for (std::size_t n = 0; (n = std::fread(chunk.data(), 1, chunk.size(), pipe)) > 0;)
    answer.out.append(chunk.data(), n);
  const int status = pclose(pipe);
  answer.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return answer;
}

class SolveCommand : public ::testing::Test {
 protected:
  // A space in the path, on purpose; one folder per test, since tests run side by side.
  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      ("anchord solve " + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
  std::string quoted() const { return "'" + folder_.string() + "'"; }
  void SetUp() override {
    fs::remove_all(folder_);
    ASSERT_EQ(run("simulate flight --seed 5 --out " + quoted()).exit_code, 0);
  }
  void TearDown() override { fs::remove_all(folder_); }
};

TEST_F(SolveCommand, PrintsJsonAloneOnStandardOutput) {
  const Answer answer = run("solve " + quoted() + " --format json");
  ASSERT_EQ(answer.exit_code, 0);
  const auto json = nlohmann::json::parse(answer.out, nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  EXPECT_EQ(json["schema"], "anchord.solve/1");
  const auto& anchors = json["flights"][0]["anchors"];
  ASSERT_EQ(anchors.size(), 6U);  // of the demonstration building
  for (const auto& anchor : anchors) {
    EXPECT_TRUE(anchor["lon"].is_number());
    EXPECT_EQ(anchor["cov_enu_m2"].size(), 6U);
    EXPECT_TRUE(anchor["verdict"].is_string());
  }
}

TEST_F(SolveCommand, ExitsZeroWhenAnAnchorIsUndetermined) {
  std::ofstream(folder_ / "ranges.csv", std::ios::app) << "50.0,0x6e01,0,0x9999,12.5,,,,99999\n";
  const Answer answer = run("solve " + quoted() + " --format csv");
  EXPECT_EQ(answer.exit_code, 0);
  EXPECT_NE(answer.out.find("0x9999,0x9999,too_few"), std::string::npos) << answer.out;
}

TEST_F(SolveCommand, ExitsTwoOnUnusableInput) {
  EXPECT_EQ(run("solve /nowhere/at/all").exit_code, 2);
  EXPECT_EQ(run("solve " + quoted() + " --format xml").exit_code, 2);
  EXPECT_EQ(run("solve " + quoted() + " --profile /nowhere.json").exit_code, 2);
  std::ofstream(folder_ / "ranges.csv", std::ios::app) << "fifty,0x6e01,0,0x9999,12.5,,,,99999\n";
  const Answer answer = run("solve " + quoted() + " --format json");
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_TRUE(answer.out.empty());
}

TEST_F(SolveCommand, TakesTheProfileItMade) {
  const std::string kit = "'" + (folder_ / "kit.json").string() + "'";
  ASSERT_EQ(run("profile fit " + quoted() + " --out " + kit).exit_code, 0);
  EXPECT_NE(run("profile show " + kit).out.find("1 flights"), std::string::npos);
  EXPECT_EQ(run("solve " + quoted() + " --profile " + kit).exit_code, 0);
}

}  // namespace
