// The real binary, as an operator calls it.
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "tests/paths.hpp"

namespace anchord::solve_command_test {
namespace {

namespace fs = std::filesystem;

struct Answer {
  int exit_code{};
  std::string out;
};

/// Standard output alone; standard error goes nowhere, or where `errors` sends it.
Answer run(const std::string& arguments, const char* errors = "2>/dev/null") {
  Answer answer;
  FILE* pipe = popen((std::string("'") + ANCHORD_BINARY + "' " + arguments + " " + errors).c_str(), "r");
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
  /// Each range anew: its distance and levels, `range_m,rx_dbm,fp_dbm`, of the distance it had.
  template <class Levels>
  void rewrite_ranges(Levels levels) {
    std::ifstream in(folder_ / "ranges.csv");
    std::string line, all;
    std::getline(in, line);
    ASSERT_EQ(line, "t_s,tag_id,antenna,anchor_id,range_m,rx_dbm,fp_dbm,rss_dbm,seq");
    all = line + '\n';
    while (std::getline(in, line)) {
      std::vector<std::string> cells;
      std::istringstream row(line);
      for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
      ASSERT_GE(cells.size(), 5U) << line;
      for (std::size_t k = 0; k < 4; ++k) all += cells[k] + ',';
      all += levels(std::stod(cells[4])) + ",,\n";
    }
    in.close();
    std::ofstream(folder_ / "ranges.csv") << all;
  }
  /// Quoted path of a bias model trained on this campaign of the folder.
  std::string bias_model(const std::string& campaign) {
    const std::string model = "'" + (folder_ / "bias.json").string() + "'";
    EXPECT_EQ(run("train --task bias --data '" + (folder_ / campaign).string() +
                  "' --group-by environment --placement setting --out " + model)
                  .exit_code,
              0);
    return model;
  }
};

TEST_F(SolveCommand, TakesPriorsUnderTheNameTheyHadUpTo01ButNotUnderBoth) {
  const auto file = "'" + (folder_ / "priors.json").string() + "'";
  std::ofstream(folder_ / "priors.json") << R"({"outline_m":[[-1,-1],[1,-1],[1,1],[-1,1]]})";
  const auto with = [&](const std::string& names) {
    return run("solve " + quoted() + " --format json" + names, "2>&1");
  };
  const auto priors = with(" --priors " + file), former = with(" --clues " + file);
  EXPECT_EQ(priors.out, former.out);
  EXPECT_NE(priors.out, with("").out) << "the anchors are far outside of that outline";
  const auto both = with(" --priors " + file + " --clues " + file);
  EXPECT_NE(both.exit_code, 0);
  EXPECT_NE(both.out.find("--priors"), std::string::npos) << both.out;
}

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

// 25 ranges cannot show that one of them is wrong: the place may be good, and is nothing to read as ok.
TEST_F(SolveCommand, CallsNothingOkThatAGateHoldsBack) {
  std::ifstream in(folder_ / "ranges.csv");
  std::string line, anchor, all;
  std::vector<std::string> thinned;
  while (std::getline(in, line)) {
    std::istringstream row(line);
    std::string id;
    for (int k = 0; k < 4; ++k) std::getline(row, id, ',');
    if (anchor.empty() && id.starts_with("0x")) anchor = id;
    if (id == anchor)
      thinned.push_back(line);
    else
      all += line + '\n';
  }
  in.close();
  ASSERT_GT(thinned.size(), 25U);
  for (std::size_t k = 0; k < 25; ++k) all += thinned[k * thinned.size() / 25] + '\n';
  std::ofstream(folder_ / "ranges.csv") << all;
  const Answer answer = run("solve " + quoted());
  ASSERT_EQ(answer.exit_code, 0);
  std::istringstream lines(answer.out);
  bool seen = false;
  while (std::getline(lines, line)) {
    if (!line.starts_with(anchor + ' ')) continue;
    seen = true;
    EXPECT_NE(line.find(" not acceptable "), std::string::npos) << line;
    EXPECT_EQ(line.find(" ok "), std::string::npos) << line;
  }
  EXPECT_TRUE(seen) << answer.out;
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

/// Rewrites a table of the flight, row by row; `change` gets the cells, and may drop the row.
void rewrite(const fs::path& file, const std::function<bool(std::vector<std::string>&)>& change) {
  std::ifstream in(file);
  std::string line, all;
  std::getline(in, line);
  all = line + '\n';
  while (std::getline(in, line)) {
    std::vector<std::string> cells;
    std::istringstream row(line);
    for (std::string cell; std::getline(row, cell, ',');) cells.push_back(cell);
    if (!change(cells)) continue;
    for (std::size_t i = 0; i < cells.size(); ++i) all += (i > 0 ? "," : "") + cells[i];
    all += '\n';
  }
  in.close();
  std::ofstream(file) << all;
}

TEST_F(SolveCommand, SolvesATrackOfOneHertz) {
  double last_s = -1;
  rewrite(folder_ / "track.csv", [&](std::vector<std::string>& cells) {
    if (std::stod(cells[0]) - last_s < 0.95) return false;
    last_s = std::stod(cells[0]);
    return true;
  });
  const Answer answer = run("solve " + quoted() + " --format json");
  EXPECT_EQ(answer.exit_code, 0);
  const auto json = nlohmann::json::parse(answer.out, nullptr, false);
  ASSERT_FALSE(json.is_discarded());
  EXPECT_TRUE(json["flights"][0]["placed"].get<bool>());
  for (const auto& anchor : json["flights"][0]["anchors"]) EXPECT_TRUE(anchor["enu_m"].is_array());
}

TEST_F(SolveCommand, SaysFirstWhyNoRangeCouldBePlacedAndEndsWithTwo) {
  rewrite(folder_ / "ranges.csv", [](std::vector<std::string>& cells) {
    cells[4] = std::to_string(1000 * std::stod(cells[4]));
    return true;
  });
  const Answer answer = run("solve " + quoted());
  EXPECT_EQ(answer.exit_code, 2);
  EXPECT_EQ(answer.out.rfind("NOT SOLVED: none of ", 0), 0U) << answer.out;
  EXPECT_NE(answer.out.find("range_m is in metres"), std::string::npos) << answer.out;
}

TEST_F(SolveCommand, RefusesWhatWouldDoNothing) {
  const auto refused = [&](const std::string& options, const std::string& what) {
    const Answer answer = run("solve " + quoted() + " " + options, "2>&1");
    EXPECT_EQ(answer.exit_code, 2) << options;
    EXPECT_NE(answer.out.find(what), std::string::npos) << options << ": " << answer.out;
  };
  refused("--height 12", "set dims to 2");
  refused("--dims 2 --height-prior 12,1", "height prior");
  refused("--likelihood loss", "--models");
  refused("--truth anchors_truth.csv", "--report");
  refused("--bias 1e9", "200");
  refused("--lever-arm-sigma 0", "--lever-arm-sigma");
  const fs::path kit = folder_ / "kit.json";
  ASSERT_EQ(run("profile fit " + quoted() + " --out '" + kit.string() + "'").exit_code, 0);
  std::stringstream text;
  text << std::ifstream(kit).rdbuf();
  auto json = nlohmann::json::parse(text.str());
  json["kit"] = "another kit";
  std::ofstream(kit) << json.dump();
  refused("--profile '" + kit.string() + "'", "another kit");
}

TEST_F(SolveCommand, WidensRegionsByTheSigmaOfTheLeverArmAndAsksNoMore) {
  const auto first = [&](const std::string& options) {
    return nlohmann::json::parse(
        run("solve " + quoted() + " --format json " + options).out)["flights"][0]["anchors"][0];
  };
  const auto asked = [](const nlohmann::json& anchor) {
    return std::ranges::any_of(anchor["gates"],
                               [](const auto& gate) { return gate["name"] == "unseen_arm"; });
  };
  const auto without = first(""), with = first("--lever-arm-sigma 0.5");
  EXPECT_TRUE(asked(without));
  EXPECT_FALSE(asked(with));
  EXPECT_GT(with["h95_m"].get<double>(), without["h95_m"].get<double>());
  auto declared = nlohmann::json::parse(std::ifstream(folder_ / "flight.json"));
  declared["lever_arm_sigma_m"] = 0.5;
  std::ofstream(folder_ / "flight.json") << declared.dump();
  EXPECT_EQ(first(""), with) << "what the flight declares is asked for no more";
}

TEST_F(SolveCommand, HoldsTheHeightInTheMetresOfItsOwnTable) {
  const auto solved = nlohmann::json::parse(run("solve " + quoted() + " --format json").out);
  const double height_m = solved["flights"][0]["anchors"][0]["h_m"].get<double>();
  const Answer answer =
      run("solve " + quoted() + " --dims 2 --height " + std::to_string(height_m) + " --format json");
  ASSERT_EQ(answer.exit_code, 0);
  const auto flat = nlohmann::json::parse(answer.out)["flights"][0]["anchors"][0];
  ASSERT_TRUE(flat["h_m"].is_number());
  EXPECT_NEAR(flat["h_m"].get<double>(), height_m, 0.01);
  EXPECT_TRUE(flat["mirror"].is_null());
}

/// Levels of one range: behind a wall 7 dB more of the first path are lost.
std::string levels(bool blocked, double distance_m, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0, 1);
  const double rx_dbm = -75 - 0.3 * distance_m + noise(random);
  return std::to_string(rx_dbm) + ',' + std::to_string(rx_dbm - (blocked ? 9.0 : 2.0) + 1.2 * noise(random));
}

/// What a wall adds: 0.2 m, and an exponential delay of 0.5 m.
double late_m(std::mt19937_64& random) {
  return 0.2 + std::exponential_distribution<double>(1 / 0.5)(random);
}

TEST_F(SolveCommand, CorrectsAndWeighsRangesWithTheModelsNamed) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> noise(0, 1);
  {
    std::ofstream campaign(folder_ / "campaign.csv");
    campaign << "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
    for (int room = 0; room < 6; ++room) {
      for (int k = 0; k < 40; ++k) {
        const bool blocked = k % 2 == 1;
        const double distance_m = 2.0 + 0.8 * k;
        campaign << "room " << room << ",s" << room * 40 + k << ',' << distance_m << ',' << !blocked << ','
                 << 1.05 * distance_m + 0.05 * noise(random) + (blocked ? late_m(random) : 0) << ','
                 << levels(blocked, distance_m, random) << '\n';
      }
    }
  }
  // A constant the flight would find by itself; a radio whose metre is 5 cm too long it does not.
  rewrite_ranges([&](double distance_m) {
    return std::to_string(1.05 * distance_m) + ',' + levels(false, distance_m, random);
  });
  const std::string model = bias_model("campaign.csv");
  const auto error_m = [&](const std::string& more) {
    const Answer answer = run("solve " + quoted() + " --format json" + more);
    EXPECT_EQ(answer.exit_code, 0);
    const auto flight = nlohmann::json::parse(answer.out)["flights"][0];
    EXPECT_EQ(flight["notes"].dump().find("likelihood of a model") != std::string::npos, !more.empty());
    std::ifstream truth(folder_ / "anchors_truth.csv");
    std::string row;
    std::getline(truth, row);
    double sum_m = 0;
    int n = 0;
    while (std::getline(truth, row)) {
      std::istringstream cells(row);
      std::string id, lat, lon;
      std::getline(cells, id, ',');
      std::getline(cells, lat, ',');
      std::getline(cells, lon, ',');
      for (const auto& anchor : flight["anchors"]) {
        if (anchor["anchor_id"] != id) continue;
        const double north_m = (anchor["lat"].get<double>() - std::stod(lat)) * 111'200;
        const double east_m =
            (anchor["lon"].get<double>() - std::stod(lon)) * 111'200 * std::cos(std::stod(lat) / 57.2957795);
        sum_m += std::hypot(north_m, east_m);
        ++n;
      }
    }
    EXPECT_EQ(n, 6);
    return sum_m / n;
  };
  // Whether so short a flight can show the worth of the model is another test's question.
  const double raw_m = error_m(""), with_m = error_m(" --worth ignored --models " + model);
  std::printf("ranges a twentieth too long: off by %.3f m raw, %.3f m with the model\n", raw_m, with_m);
  EXPECT_LT(with_m, 0.7 * raw_m);
  EXPECT_EQ(run("solve " + quoted() + " --models " + model + " " + model).exit_code, 2) << "one a task";
  EXPECT_EQ(run("solve " + quoted() + " --models /nowhere.json").exit_code, 2);
}

TEST_F(SolveCommand, ComparesTheMethodsOfTheDissertationAndAcceptsNone) {
  const auto solved = [&](const std::string& more) {
    const Answer answer = run("solve " + quoted() + " --format json" + more);
    EXPECT_EQ(answer.exit_code, 0);
    return nlohmann::json::parse(answer.out)["flights"][0]["anchors"][0];
  };
  const auto joint = solved(""), linear = solved(" --method linear"), wls = solved(" --method wls");
  EXPECT_EQ(joint["methods"], wls["methods"]);
  EXPECT_EQ(linear["enu_m"], joint["methods"]["linear_enu_m"]);
  EXPECT_EQ(wls["enu_m"], joint["methods"]["wls_enu_m"]);
  EXPECT_NE(joint["enu_m"], wls["enu_m"]);
  EXPECT_TRUE(linear["h95_m"].is_null());
  EXPECT_TRUE(wls["h95_m"].is_number());
  for (const auto* one : {&linear, &wls}) {
    EXPECT_FALSE((*one)["acceptable"]);
    EXPECT_EQ((*one)["gates"][0]["name"], "method");
  }
  const auto page = folder_ / "page.html";
  ASSERT_EQ(run("solve " + quoted() + " --iterations 0 --report '" + page.string() + "' --truth '" +
                (folder_ / "anchors_truth.csv").string() + "'")
                .exit_code,
            0);
  std::stringstream html;
  html << std::ifstream(page).rdbuf();
  EXPECT_NE(html.str().find("Methods compared"), std::string::npos);
  EXPECT_NE(html.str().find("What would help most"), std::string::npos);
  EXPECT_NE(run("solve " + quoted() + " --method linear --format csv").out.find(",0,method"),
            std::string::npos);
  EXPECT_EQ(run("solve " + quoted() + " --method linear").out.find("nan"), std::string::npos);
}

/// A radio whose ranges err with the level, as this flight's do not: what it taught only adds noise here.
TEST_F(SolveCommand, LeavesModelsOutOfAFlightThatTheyDoNotExplain) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> noise(0, 1);
  const auto level_dbm = [&] { return -80 + 6 * noise(random); };
  {
    std::ofstream campaign(folder_ / "elsewhere.csv");
    campaign << "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
    for (int room = 0; room < 6; ++room) {
      for (int k = 0; k < 40; ++k) {
        const double distance_m = 2.0 + 0.8 * k, rx_dbm = level_dbm();
        const double excess_m = 0.08 * (rx_dbm + 80) + (k % 2 == 1 ? 0.4 : 0.0);
        campaign << "room " << room << ",s" << room * 40 + k << ',' << distance_m << ',' << (k % 2 == 0)
                 << ',' << distance_m + excess_m + 0.05 * noise(random) << ',' << rx_dbm << ','
                 << rx_dbm - (k % 2 == 1 ? 9 : 2) << '\n';
      }
    }
  }
  rewrite_ranges([&](double distance_m) {
    const double rx_dbm = level_dbm();
    return std::to_string(distance_m) + ',' + std::to_string(rx_dbm) + ',' + std::to_string(rx_dbm - 2);
  });
  const std::string model = bias_model("elsewhere.csv");
  const auto flight = [&](const std::string& more) {
    const Answer answer = run("solve " + quoted() + " --format json" + more);
    EXPECT_EQ(answer.exit_code, 0);
    return nlohmann::json::parse(answer.out)["flights"][0];
  };
  const auto raw = flight(""), asked = flight(" --models " + model),
             forced = flight(" --models " + model + " --worth ignored");
  EXPECT_TRUE(raw["models"].is_null());
  EXPECT_TRUE(forced["models"]["used"]);
  EXPECT_TRUE(forced["models"]["worth"].is_null());
  EXPECT_NE(forced["anchors"][0]["enu_m"], raw["anchors"][0]["enu_m"]);
  EXPECT_FALSE(asked["models"]["used"]);
  EXPECT_FALSE(asked["models"]["worth"]["shown"]);
  EXPECT_LT(asked["models"]["worth"]["gain_per_range"], 0);
  EXPECT_NE(asked["notes"].dump().find("do not explain this flight better"), std::string::npos);
  for (std::size_t i = 0; i < raw["anchors"].size(); ++i)
    EXPECT_EQ(asked["anchors"][i]["enu_m"], raw["anchors"][i]["enu_m"]);
  EXPECT_NE(run("solve " + quoted() + " --models " + model, "2>&1").out.find("solved without them"),
            std::string::npos);
}

}  // namespace
}  // namespace anchord::solve_command_test
