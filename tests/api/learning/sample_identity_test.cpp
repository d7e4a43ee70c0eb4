// Campaigns of strangers through the routes: which samples are the same, which models replace which, and what
// a file that is not understood becomes.
#include <algorithm>

#include "tests/api/app_fixture.hpp"

namespace anchord::test::sample_identity_test {
namespace {

constexpr const char* k_samples = "/api/v1/campaigns/hall/samples";

class ForeignCampaigns : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"hall"})").status, 201);
  }
  Json send(const std::string& text, const std::string& type = "text/csv",
            const std::string& path = k_samples) {
    const auto answer = post(path, text, type);
    return json(answer);
  }
  std::size_t stored() { return json(get("/api/v1/campaigns/hall"))["n_samples"].get<std::size_t>(); }
  /// LOS ranges of ten settings in one room, `bias_m` too long, as `unit` of a metre.
  static std::string room(const std::string& name, double bias_m, double unit = 1) {
    std::string csv = "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
    for (int i = 0; i < 40; ++i) {
      const double true_m = 3 + 0.5 * (i / 4), off_m = bias_m + 0.01 * (i % 4);
      csv += name + ' ' + std::to_string(i / 8) + ',' + name + std::to_string(i / 4) + ',' +
             std::to_string(true_m) + ",1," + std::to_string(unit * (true_m + off_m)) + ',' +
             std::to_string(-80 - i % 7) + ',' + std::to_string(-83 - i % 5) + '\n';
    }
    return csv;
  }
  Json trained_on(const std::string& name, const std::string& csv) {
    EXPECT_EQ(post("/api/v1/campaigns", Json{{"name", name}}.dump()).status, 201);
    EXPECT_EQ(post("/api/v1/campaigns/" + name + "/samples", csv, "text/csv").status, 200);
    EXPECT_EQ(post("/api/v1/datasets",
                   Json{{"name", name}, {"campaigns", {name}}, {"split", {{"test_share", 0.2}}}}.dump())
                  .status,
              201);
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto run = call(api::Method::post, "/api/v1/training-runs",
                          R"({"task":"los_bias","dataset":")" + name +
                              R"(","methods":["constant"],"cv":{"folds":4,"seed":3},"importance":false})",
                          options);
    EXPECT_EQ(run.status, 201) << run.body;
    return json(run);
  }
  api::Response promote(const Json& run, const std::string& body = "") {
    return post(run.value("model", "") + "/promote", body);
  }
};

TEST_F(ForeignCampaigns, ASecondSessionOfTheSameTimesIsKept) {
  const std::string header = "environment,setting,true_distance_m,los,t_s,range_m,rx_dbm\n";
  const auto session = [&](double range_m) {
    std::string out = header;
    for (int i = 0; i < 10; ++i)
      out += "lab,s,5,1," + std::to_string(1'500'000'000 + i) + ',' + std::to_string(range_m + 0.001 * i) +
             ",-80\n";
    return out;
  };
  EXPECT_EQ(send(session(5.1))["accepted"], 10);
  const auto second = send(session(5.3));
  EXPECT_EQ(second["accepted"], 10) << second;
  EXPECT_EQ(second["duplicates"], 0);
  EXPECT_EQ(stored(), 20u);
  EXPECT_EQ(send(session(5.1))["duplicates"], 10);
  EXPECT_EQ(send(session(5.3))["duplicates"], 10);
  EXPECT_EQ(stored(), 20u);
}

TEST_F(ForeignCampaigns, ACommentLineMoreIsNoOtherCampaign) {
  const std::string timed =
      "environment,setting,true_distance_m,los,t_s,range_m\nlab,s,5,1,1500000000,5.1\nlab,s,5,1,1500000000,5."
      "2\n";
  const std::string untimed =
      "environment,setting,true_distance_m,los,range_m\nlab,u,5,1,5.1\nlab,u,5,1,5.1\n";
  for (const auto& text : {timed, untimed}) {
    EXPECT_EQ(send(text)["accepted"], 2);
    const auto again = send("# measured again on Monday\n" + text);
    EXPECT_EQ(again["accepted"], 0) << again;
    EXPECT_EQ(again["duplicates"], 2);
  }
  EXPECT_EQ(stored(), 4u);
}

TEST_F(ForeignCampaigns, WhatTheServerGaveOutAddsNothing) {
  const std::string csv =
      "environment,setting,true_distance_m,los,truth_sd_m,t_s,range_m,rx_dbm,fp_dbm,fp_amp1,rxpacc\n"
      "lab,=s,5,1,0.01,1500000000.123456,5.123456789012345,-80.25,-82,9000,1001\n"
      "lab,=s,5,1,0.01,1500000000.223457,5.1,-80.5,-82.5,9001,1002\n"
      "lab,t,4,0,,,4.6,-85,,,\nlab,t,4,0,,,4.7,,,,\n";
  ASSERT_EQ(send(csv)["accepted"], 4);
  const auto out = get(k_samples, {{"format", "csv"}});
  ASSERT_EQ(out.status, 200);
  const auto exported = text(out);
  const auto again = send(exported);
  EXPECT_EQ(again["accepted"], 0) << again << exported;
  EXPECT_EQ(again["duplicates"], 4) << again;
  const auto lines = text(get(k_samples, {{"format", "ndjson"}, {"features", "true"}}));
  const auto third = send(lines, "application/x-ndjson");
  EXPECT_EQ(third["accepted"], 0) << third << lines;
  EXPECT_EQ(third["duplicates"], 4) << third;
  EXPECT_EQ(stored(), 4u);
}

TEST_F(ForeignCampaigns, AFileOfExcelIsReadAndOneThatIsNotUnderstoodIsRefused) {
  const auto excel = send("sep=;\r\nenvironment;setting;true_distance_m;los;range_m\r\nlab;s;4,5;1;4,52\r\n");
  EXPECT_EQ(excel["accepted"], 1) << excel;
  EXPECT_EQ(json(get(k_samples))["items"][0]["range_m"], 4.52);
  // Metres where millimetres are: 4.5 mm is no range.
  const auto metres = post(k_samples, "1 4.51 -79\n2 4.52 -79\n", "text/plain");
  EXPECT_EQ(metres.status, 422) << metres.body;
  EXPECT_NE(metres.body.find("shorter than any radio measures"), std::string::npos) << metres.body;
  const auto table = post(k_samples, "id;dist;level\n1;4.51;-79\n", "text/csv");
  EXPECT_EQ(table.status, 422) << table.body;
  EXPECT_NE(table.body.find("no column of measured ranges"), std::string::npos) << table.body;
  EXPECT_EQ(stored(), 1u);
}

TEST_F(ForeignCampaigns, PlacesThatDifferInCapitalsAreSaid) {
  const std::string header = "environment,setting,true_distance_m,los,range_m\n";
  EXPECT_TRUE(send(header + "Room 1,s,5,1,5.1\nRoom 2,t,5,1,5.1\n")["warnings"].empty());
  const auto other = send(header + "room 1,u,5,1,5.1\nRoom  2,v,5,1,5.1\n")["warnings"];
  ASSERT_EQ(other.size(), 2u) << other;
  EXPECT_NE(other[0].get<std::string>().find(R"("Room 1", "room 1")"), std::string::npos) << other;
  const auto set = json(post("/api/v1/datasets", R"({"name":"set","campaigns":["hall"]})"));
  EXPECT_NE(set["report"]["warnings"].dump().find("room 1"), std::string::npos) << set;
}

// In the odd room every range is 0.6 m too long; the model of it is right there, and half a metre off at
// home.
TEST_F(ForeignCampaigns, AModelOfOneOddRoomDoesNotReplaceAGoodOneWithoutAReason) {
  const auto home = trained_on("home", room("home", 0.1));
  ASSERT_EQ(promote(home).status, 200);
  const auto odd = trained_on("odd", room("odd", 0.6));
  const auto refused = promote(odd);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_NE(refused.body.find("of the active model on the places of the active model"), std::string::npos)
      << refused.body;
  EXPECT_EQ(json(get("/api/v1/models/active"))["models"]["los_bias"]["id"].dump(),
            Json(home.value("model", "").substr(15)).dump());
  EXPECT_EQ(promote(odd, R"({"reason":"the hall was rebuilt"})").status, 200);
}

// Whoever writes a manifest can copy the digest of somebody's data into it.
TEST_F(ForeignCampaigns, AManifestFromElsewhereDoesNotSayThatItsDataAreThoseOfTheActiveModel) {
  const auto home = trained_on("home", room("home", 0.1));
  ASSERT_EQ(promote(home).status, 200);
  auto foreign = json(get(home.value("model", "") + "/artifact"));
  foreign.erase("signature");
  foreign["manifest"]["method"] = "of another server";
  const auto made = post("/api/v1/models", foreign.dump());
  ASSERT_EQ(made.status, 201) << made.body;
  const auto gate = json(get("/api/v1/models/" + json(made).value("id", "") + "/gate"));
  const auto on_places = std::ranges::count_if(
      gate["checks"], [](const Json& check) { return check["basis"] == "active_places"; });
  EXPECT_EQ(on_places, 1) << gate;
}

TEST_F(ForeignCampaigns, TheSameSamplesInMillimetresOrCentimetresAreDuplicates) {
  const auto csv = [](int per_m, const std::string& unit) {
    std::string out = "environment,setting,true_distance_" + unit + ",los,range_" + unit + "\n";
    for (int i = 0; i < 500; ++i) {
      char row[80];
      const double range = (5.0 + 0.01 * i) * per_m;
      std::snprintf(row, sizeof row, "lab,s,%d,1,%.*f\n", 5 * per_m, per_m == 1 ? 2 : 0, range);
      out += row;
    }
    return out;
  };
  EXPECT_EQ(send(csv(1, "m"))["accepted"], 500);
  EXPECT_EQ(send(csv(100, "cm"))["duplicates"], 500);
  EXPECT_EQ(send(csv(1000, "mm"))["duplicates"], 500);
}

TEST_F(ForeignCampaigns, AModelOfNanosecondsIsRefused) {
  const auto run = trained_on("ns", room("ns", 0.1, 3.33564));
  const auto refused = promote(run);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_NE(refused.body.find("no ranges of a radio in metres"), std::string::npos) << refused.body;
  // By a person's word it is active, and yet moves nothing by metres.
  ASSERT_EQ(promote(run, R"({"reason":"to see"})").status, 200);
  const auto said =
      json(post("/api/v1/models/active/predict", R"({"sample":{"distance_m":8,"rx_dbm":-81,"fp_dbm":-84}})"));
  EXPECT_TRUE(said["bias_m"].is_null()) << said;
  EXPECT_NE(said.value("note", "").find("withheld"), std::string::npos) << said;
}

TEST_F(ForeignCampaigns, ALevelThatSaysThereIsNoneIsNoLevel) {
  const auto csv =
      send("environment,setting,true_distance_m,los,range_m,rx_dbm\nlab,s,5,1,5.1,-999\nlab,s,5,1,5.1,-80\n");
  EXPECT_EQ(csv["accepted"], 1) << csv;
  EXPECT_EQ(csv["errors"][0]["column"], "rx_dbm");
  const auto plain = send("1500000000000 5100 -999\n1500000001000 5100 -80\n", "text/plain");
  EXPECT_EQ(plain["accepted"], 1) << plain;
  const auto frozen =
      post("/api/v1/datasets",
           "feature_set,campaign,environment,setting,split,los,true_range_m,repeats,range_m,rx_dbm\n"
           "anchord-features-2,c,lab,s,train,1,5,1,5.1,-999\n",
           "text/csv", {{"name", "sentinels"}});
  EXPECT_EQ(frozen.status, 422) << frozen.body;
  EXPECT_NE(frozen.body.find("rx_dbm must be -200 to 50 dBm"), std::string::npos) << frozen.body;
}

}  // namespace
}  // namespace anchord::test::sample_identity_test
