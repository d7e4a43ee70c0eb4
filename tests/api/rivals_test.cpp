// Eight clients at once: whoever checks a state and then acts on it decides inside the write transaction, so
// one wins and the others are told that the state moved on.
#include <algorithm>
#include <barrier>
#include <set>
#include <thread>
#include <vector>

#include "api/calibration/kit_profile_json.hpp"
#include "app_fixture.hpp"
#include "core/ports/access_store.hpp"
#include "core/ports/revision_store.hpp"
#include "core/types/anchor.hpp"

namespace anchord::test::rivals_test {
namespace {

using api::Method;

constexpr int k_rivals = 8;

class Rivals : public AppFixture {
 protected:
  /// The same request by eight threads that start together; the statuses.
  std::multiset<int> together(Method method, const std::string& path, const std::string& body,
                              const std::string& if_match = "") {
    std::vector<int> status(k_rivals);
    std::barrier start(k_rivals);
    std::vector<std::jthread> threads;
    for (int i = 0; i < k_rivals; ++i) {
      threads.emplace_back([&, i] {
        Call options;
        if (!if_match.empty()) options.headers["if-match"] = if_match;
        start.arrive_and_wait();
        status[static_cast<std::size_t>(i)] = call(method, path, body, options).status;
      });
    }
    threads.clear();
    return {status.begin(), status.end()};
  }
  /// One 2xx; all others say that somebody else was first.
  static void expect_one_wins(const std::multiset<int>& status, int good, const std::set<int>& others) {
    EXPECT_EQ(status.count(good), 1u) << ::testing::PrintToString(status);
    for (const int one : status) EXPECT_TRUE(one == good || others.contains(one)) << one;
  }
  std::string calibration() {
    return stored_calibration([](Estimate&) {});
  }
  std::size_t revisions() { return json(get("/api/v1/revisions"))["items"].size(); }
};

TEST_F(Rivals, OneOfEightPublicationsOfACalibrationMakesTheRevision) {
  const auto path = "/api/v1/calibrations/" + calibration() + "/publish";
  expect_one_wins(together(Method::post, path, "{}"), 201, {409});
  EXPECT_EQ(revisions(), 1u);
  EXPECT_EQ(post(path, "{}").status, 409) << "nothing would change";
  EXPECT_EQ(revisions(), 1u);
}

TEST_F(Rivals, APublicationThatWasJudgedOnAnOlderRevisionIsRefusedAndAudited) {
  const auto first = calibration(), second = calibration();
  std::vector<int> status(k_rivals);
  std::barrier start(k_rivals);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < k_rivals; ++i) {
      threads.emplace_back([&, i] {
        start.arrive_and_wait();
        status[static_cast<std::size_t>(i)] =
            post("/api/v1/calibrations/" + (i % 2 == 0 ? first : second) + "/publish", "{}").status;
      });
    }
  }
  // Two calibrations may take turns; never is one revision the same as that before it.
  const auto made = std::ranges::count(status, 201);
  EXPECT_EQ(std::ranges::count(status, 409), k_rivals - made);
  const auto rows = database_->stores().revisions.revisions(100, 0).value();
  ASSERT_EQ(rows.size(), static_cast<std::size_t>(made));
  for (std::size_t i = 1; i < rows.size(); ++i) EXPECT_NE(rows[i].calibration, rows[i - 1].calibration);
  std::size_t refused = 0;
  for (const auto log = database_->stores().access.audit(1000); const auto& entry : log.value())
    refused += entry.what.starts_with("calibration.publish") && entry.result.starts_with("refused: ");
  EXPECT_LE(refused, static_cast<std::size_t>(k_rivals - made));
}

TEST_F(Rivals, OneOfEightChangesOfASiteAFrameAndAPlanIsStored) {
  for (const auto& [where, make, change] :
       {std::tuple{"/api/v1/sites", R"({"name":"Ghent"})", R"({"name":"West"})"},
        std::tuple{"/api/v1/frames", R"({"name":"hall"})", R"({"name":"hall west"})"},
        std::tuple{"/api/v1/plans", R"({"name":"Hall A"})", R"({"name":"Hall B"})"}}) {
    const auto made = post(where, make);
    ASSERT_EQ(made.status, 201) << made.body;
    const auto path = std::string(where) + "/" + json(made).value("id", "");
    expect_one_wins(together(Method::patch, path, change, header(made, "ETag")), 200, {409, 412});
    const auto now = get(path);
    EXPECT_EQ(json(now)["name"], Json::parse(change)["name"]);
    expect_one_wins(together(Method::del, path, "", header(now, "ETag")), 204, {404, 409, 412});
  }
}

TEST_F(Rivals, AChangeAndARemovalFromTheSameVersionAreNotBothDone) {
  for (int round = 0; round < 20; ++round) {
    const auto made = post("/api/v1/sites", R"({"name":"Ghent"})");
    const auto path = "/api/v1/sites/" + json(made).value("id", "");
    Call options;
    options.headers["if-match"] = header(made, "ETag");
    int changed = 0, removed = 0;
    std::barrier start(2);
    {
      const std::jthread one([&] {
        start.arrive_and_wait();
        changed = call(Method::patch, path, R"({"name":"West"})", options).status;
      });
      const std::jthread two([&] {
        start.arrive_and_wait();
        removed = call(Method::del, path, "", options).status;
      });
    }
    EXPECT_EQ((changed == 200) + (removed == 204), 1) << changed << ' ' << removed;
  }
}

TEST_F(Rivals, OneOfEightFacilityChangesOfAnAnchorIsStored) {
  ASSERT_EQ(post("/api/v1/calibrations/" + calibration() + "/publish", "{}").status, 201);
  const auto read = get("/api/v1/anchors/0x6a2f");
  expect_one_wins(
      together(Method::patch, "/api/v1/anchors/0x6a2f", R"({"name":"north"})", header(read, "ETag")), 200,
      {409, 412});
}

TEST_F(Rivals, OneOfEightProfilesReplacesTheOneThatWasRead) {
  KitProfile profile;
  profile.kit = "quad-02";
  const auto first = call(Method::put, "/api/v1/devices/quad-02/profile", kit_profile_json(profile),
                          {{"application/json"}, {}, {{"if-match", "*"}}});
  ASSERT_EQ(first.status, 201) << first.body;
  expect_one_wins(together(Method::put, "/api/v1/devices/quad-02/profile", kit_profile_json(profile),
                           header(first, "ETag")),
                  200, {409, 412});
}

TEST_F(Rivals, OneOfEightFinishesAMission) {
  const auto id = mission();
  expect_one_wins(together(Method::post, "/api/v1/missions/" + id + "/actions", R"({"action":"finish"})"),
                  200, {422});
  std::size_t told = 0;
  const auto events = json(get("/api/v1/missions/" + id + "/events"));
  for (const auto& event : events["items"]) told += event["code"] == "mission.finished";
  EXPECT_EQ(told, 1u);
}

TEST_F(Rivals, OneOfEightCampaignsFramesAndDataSetsTakesAName) {
  expect_one_wins(together(Method::post, "/api/v1/campaigns", R"({"name":"hall"})"), 201, {409});
  expect_one_wins(together(Method::post, "/api/v1/frames", R"({"name":"hall"})"), 201, {409});
}

TEST_F(Rivals, LabelsOfEightAreEachWhole) {
  const auto id = mission("local");
  ASSERT_EQ(post("/api/v1/ranges",
                 R"({"t_us":1777889472345678,"tag":"0x6e01","anchor":"0x6a2f","distance_m":7.4})"
                 "\n",
                 "application/x-ndjson", {{"mission", id}})
                .status,
            200);
  std::vector<std::jthread> threads;
  std::barrier start(k_rivals);
  for (int i = 0; i < k_rivals; ++i) {
    threads.emplace_back([&, i] {
      Call options;
      options.query = {{"mission", id}};
      start.arrive_and_wait();
      const auto done = call(
          Method::patch, "/api/v1/ranges",
          R"({"distance_m":)" + std::to_string(7 + i) + R"(,"los":)" + (i % 2 == 0 ? "true" : "false") + "}",
          options);
      EXPECT_EQ(done.status, 200) << done.body;
    });
  }
  threads.clear();
  const auto truth = json(get("/api/v1/ranges", {{"mission", id}}))["items"][0]["truth"];
  const int told = static_cast<int>(truth.value("distance_m", 0.0)) - 7;
  EXPECT_EQ(truth.value("los", false), told % 2 == 0) << truth;
}

}  // namespace
}  // namespace anchord::test::rivals_test
