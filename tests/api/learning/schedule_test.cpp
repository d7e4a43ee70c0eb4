// A campaign against the measurement grid of the dissertation (4.2).
#include "tests/api/app_fixture.hpp"

namespace anchord::test::schedule_test {
namespace {

class CampaignSchedule : public AppFixture {};

TEST_F(CampaignSchedule, SaysWhatOfTheGridOfADissertationsCampaignIsMissing) {
  ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"grid"})").status, 201);
  // 2 m, level, ahead: twice. 2.5 m, 1 m below, all but round (355 degrees is 0). Off the grid: 30 m; no
  // height.
  const auto imported =
      post("/api/v1/campaigns/grid/samples",
           "environment,setting,true_distance_m,los,heading_deg,height_difference_m,range_m\n"
           "a,s1,2.0,1,0,0,2.05\na,s1,2.0,1,0,0,2.06\na,s2,2.6,1,355,-1,2.61\n"
           "a,s3,30,1,0,0,30\n",
           "text/csv");
  ASSERT_EQ(json(imported)["accepted"], 4) << imported.body;
  const auto whole = json(get("/api/v1/campaigns/grid/schedule", {{"limit", "1000"}}));
  EXPECT_EQ(whole["n_planned"], 17 * 5 * 16);
  EXPECT_EQ(whole["n_measured"], 2);
  EXPECT_EQ(whole["n_samples_off_grid"], 1);
  EXPECT_EQ(whole["missing"].size(), 1000u);
  EXPECT_EQ(whole["missing"][0]["heading_deg"], 22.5);  // 0 degrees at 2 m is measured
  EXPECT_EQ(whole["by_distance"][0]["n_measured"], 1);
  EXPECT_EQ(whole["by_distance"][1]["n_measured"], 1);
  EXPECT_EQ(whole["by_distance"][2]["n_measured"], 0);
  const auto rest = json(get("/api/v1/campaigns/grid/schedule",
                             {{"limit", "1000"}, {"cursor", whole["next_cursor"].get<std::string>()}}));
  EXPECT_EQ(rest["missing"].size(), 358u);
  EXPECT_TRUE(rest["next_cursor"].is_null());
  EXPECT_EQ(json(get("/api/v1/campaigns/grid/schedule", {{"samples", "2"}}))["n_measured"], 1);
  EXPECT_EQ(json(get("/api/v1/campaigns/grid/schedule", {{"los", "false"}}))["n_measured"], 0);
  EXPECT_EQ(json(get("/api/v1/campaigns/grid/schedule", {{"environment", "b"}}))["n_samples_off_grid"], 0);
  EXPECT_EQ(get("/api/v1/campaigns/nowhere/schedule").status, 404);
  EXPECT_EQ(get("/api/v1/campaigns/grid/schedule", {{"cursor", "x"}}).status, 422);
}

}  // namespace
}  // namespace anchord::test::schedule_test
