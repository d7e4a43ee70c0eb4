// Campaign, data set, training run, promotion and live use through the routes, over a real database.
#include <sqlite3.h>

#include <algorithm>
#include <thread>

#include "core/ports/learning_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "drivers/sim/flight.hpp"
#include "tests/api/app_fixture.hpp"

namespace anchord::test::service_test {
namespace {

/// Six rooms of ten settings: a wall takes 6 dB of the first path and adds half a metre.
std::string campaign_csv() {
  std::string csv = "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
  std::uint64_t state = 1;
  const auto noise = [&state] {  // uniform -1..1; any generator will do
    state = state * 6364136223846793005ULL + 1442695040888963407ULL;
    return static_cast<double>(state >> 11) * 0x1.0p-52 - 1.0;
  };
  for (int room = 0; room < 6; ++room) {
    for (int k = 0; k < 10; ++k) {
      const bool los = k % 2 == 0;
      const double distance = 2.0 + k + 0.1 * room;
      for (int repeat = 0; repeat < 3; ++repeat) {
        const double rx = -75 - distance + noise();
        const double fp = rx - (los ? 2.0 : 8.0) + 1.5 * noise();
        const double range = distance + (los ? 0.05 : 0.55) + 0.03 * noise();
        csv += "room " + std::to_string(room) + ",s" + std::to_string(room * 10 + k) + "," +
               std::to_string(distance) + "," + (los ? "1" : "0") + "," + std::to_string(range) + "," +
               std::to_string(rx) + "," + std::to_string(fp) + "\n";
      }
    }
  }
  return csv + "room 0,s0,2.0,1,0,-80,-82\n";  // the radio's failure value
}

class LearningService : public AppFixture {
 protected:
  void SetUp() override {
    AppFixture::SetUp();
    ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"hall"})").status, 201);
    imported_ = post("/api/v1/campaigns/hall/samples", campaign_csv(), "text/csv");
    const auto made = post("/api/v1/datasets", R"({"name":"set","campaigns":["hall"],"aggregation":"none",
      "split":{"by":"environment","test":["room 5"]}})");
    ASSERT_EQ(made.status, 201) << made.body;
    dataset_ = json(made);
  }
  Json train(const std::string& task, const std::string& method) {
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto run = call(api::Method::post, "/api/v1/training-runs",
                          R"({"task":")" + task + R"(","dataset":"set","methods":[")" + method +
                              R"("],"cv":{"folds":4,"seed":3},"importance":false})",
                          options);
    EXPECT_EQ(run.status, 201) << run.body;
    return json(run);
  }
  api::Response promote(const Json& run, const std::string& body = "") {
    return post(run.value("model", "") + "/promote", body);
  }
  api::Response imported_;
  Json dataset_;
};

TEST_F(LearningService, ReportsWhatAnImportDropped) {
  ASSERT_EQ(imported_.status, 200) << imported_.body;
  // Zero is what Pozyx gives for no range: a file of nothing else is refused, with the report.
  const auto none =
      post("/api/v1/campaigns/hall/samples", "distance_m,range_m,los\n5,0,1\n5,0,1\n", "text/csv");
  EXPECT_EQ(none.status, 422) << none.body;
  EXPECT_EQ(json(none)["status"], 422);
  EXPECT_EQ(json(none)["accepted"], 0);
  EXPECT_EQ(json(none)["read"], 2);
  EXPECT_EQ(json(imported_)["accepted"], 180);
  const auto dropped = json(imported_)["dropped"];
  ASSERT_EQ(dropped.size(), 1u);
  EXPECT_EQ(dropped[0]["reason"], "zero range");
  EXPECT_EQ(dropped[0]["count"], 1);
  EXPECT_EQ(dropped[0]["first"][0]["line"], 182);
  EXPECT_EQ(dropped[0]["first"][0]["column"], "range_m");
  const auto answer = post("/api/v1/campaigns/hall/samples",
                           "environment,setting,true_distance_m,los,range_m,rx_dbm\n"
                           "room 9,t9,2,1,2.05,-80\nroom 9,t9,2,1,,-80\nroom 9,t9,2,1,2.05,900\nroom 9,t9\n",
                           "text/csv");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto bad = json(answer);
  EXPECT_EQ(bad["kept"], 1);
  ASSERT_EQ(bad["errors"].size(), 3u);
  EXPECT_EQ(bad["errors"][0]["line"], 3);
  EXPECT_EQ(bad["errors"][0]["column"], "range_m");
  EXPECT_EQ(bad["errors"][1]["column"], "rx_dbm");
  EXPECT_TRUE(bad["errors"][2]["column"].is_null());
  EXPECT_EQ(post("/api/v1/campaigns/hall/samples", "x", "application/pdf").status, 415);
  EXPECT_EQ(post("/api/v1/campaigns/nowhere/samples", "x", "text/csv").status, 404);
  EXPECT_EQ(post("/api/v1/campaigns", R"({"name":"hall"})").status, 409);
}

TEST_F(LearningService, TheSameCampaignSentTwiceIsOneCampaign) {
  const auto again = json(post("/api/v1/campaigns/hall/samples", campaign_csv(), "text/csv"));
  EXPECT_EQ(again["accepted"], 0) << again;
  EXPECT_EQ(again["duplicates"], 180);
  EXPECT_EQ(json(post("/api/v1/datasets", R"({"name":"once","campaigns":["hall"]})"))["train"], 180);
  // Another spelling of the same numbers is the same campaign; one number more is one sample more.
  auto semicolons = campaign_csv();
  std::ranges::replace(semicolons, ',', ';');
  EXPECT_EQ(json(post("/api/v1/campaigns/hall/samples", semicolons, "text/csv"))["accepted"], 0);
  const auto more = campaign_csv() + "room 0,s0,2.0,1,2.05,-77,-79\n";
  EXPECT_EQ(json(post("/api/v1/campaigns/hall/samples", more, "text/csv"))["accepted"], 1);
  // A still link may measure one number twice.
  const auto one =
      R"({"setting":"s0","environment":"room 0","true_distance_m":2.0,"los":true,"range_m":2.1})";
  for (int i = 0; i < 2; ++i)
    EXPECT_EQ(json(post("/api/v1/campaigns/hall/samples", one, "application/x-ndjson"))["accepted"], 1);
}

TEST_F(LearningService, TheCurveOfABiasRunIsNamedByItsCorrection) {
  const auto run = train("bias", "auto");
  const auto curves = json(get("/api/v1/training-runs/" + run.value("id", "") + "/cdf"))["items"];
  ASSERT_EQ(curves.size(), 2u) << curves;
  EXPECT_EQ(curves[0]["method"], "none");
  const auto name = curves[1].value("method", "");
  EXPECT_TRUE(name.starts_with("mixture") || name.starts_with("class medians") || name.starts_with("none"))
      << name;
}

TEST_F(LearningService, FreezesRowsWhoseCsvGivesTheSameDigest) {
  EXPECT_EQ(dataset_["train"], 150);
  EXPECT_EQ(dataset_["test"], 30);
  EXPECT_EQ(dataset_["leak"], false);
  const auto csv = get("/api/v1/datasets/set/rows", {{"format", "csv"}}).body;
  const auto again = post("/api/v1/datasets", csv, "text/csv", {{"name", "copy"}});
  ASSERT_EQ(again.status, 201) << again.body;
  EXPECT_EQ(json(again)["digest"], dataset_["digest"]);
  // One number changed is another data set.
  auto other = csv;
  other[other.find(",train,1,") + 7] = '0';
  EXPECT_NE(json(post("/api/v1/datasets", other, "text/csv", {{"name", "other"}}))["digest"],
            dataset_["digest"]);
  EXPECT_EQ(post("/api/v1/datasets", "a,b\n1,2\n", "text/csv", {{"name", "bad"}}).status, 422);
}

TEST_F(LearningService, CallsAPlaceOnBothSidesALeak) {
  auto csv = get("/api/v1/datasets/set/rows", {{"format", "csv"}}).body;
  csv.replace(csv.find(",train,"), 7, ",test,");
  const auto made = json(post("/api/v1/datasets", csv, "text/csv", {{"name", "leaky"}}));
  EXPECT_EQ(made["leak"], true);
  EXPECT_EQ(made["report"]["shared"]["environments"][0], "room 0");
}

TEST_F(LearningService, TrainsTheSameBytesTwiceAndMeasuresOnTheRoomItNeverSaw) {
  const auto a = train("nlos_id", "logistic"), b = train("nlos_id", "logistic");
  EXPECT_EQ(get(a.value("model", "") + "/artifact").body, get(b.value("model", "") + "/artifact").body);
  // 6 dB apart with 1.5 dB of noise: a line separates them.
  EXPECT_GT(a["test"]["accuracy"], 0.95);
  EXPECT_EQ(a["test"]["n"], 30);
  const auto base = "/api/v1/training-runs/" + a.value("id", "");
  for (const char* part : {"folds", "grid", "importance", "selection", "confusion", "roc", "cdf"})
    EXPECT_EQ(get(base + "/" + part).status, 200) << part;
  EXPECT_EQ(json(get(base + "/predictions", {{"split", "test"}}))["items"].size(), 30u);
}

TEST_F(LearningService, PromotesOnlyACorrectionThatHelpsUnlessAReasonIsGiven) {
  EXPECT_EQ(json(get("/api/v1/models/active"))["raw"], true);
  const auto none = train("los_bias", "none");
  const auto refused = promote(none);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_EQ(promote(none, R"({"reason":"as an example"})").status, 200);
  const auto helps = train("los_bias", "constant");
  const auto done = promote(helps);
  EXPECT_EQ(done.status, 200) << done.body;
  EXPECT_EQ(json(done)["gate"]["passed"], true);
  EXPECT_EQ(promote(helps).status, 422);  // it is active already
  const auto back = post("/api/v1/models/rollback", R"({"task":"los_bias"})");
  ASSERT_EQ(back.status, 200);
  EXPECT_EQ("/api/v1/models/" + json(back).value("model", ""), none["model"]);
  EXPECT_TRUE(json(post("/api/v1/models/rollback", R"({"task":"los_bias"})"))["model"].is_null());
  EXPECT_EQ(post("/api/v1/models/rollback", R"({"task":"los_bias"})").status, 422);
  EXPECT_EQ(json(get("/api/v1/models/promotions"))["items"].size(), 4u);
}

// A mean of three is less noisy than the range it will judge: its own figures say nothing of flights.
TEST_F(LearningService, AModelOfMeansIsMarkedNotForLiveAndMeasuredOnSingleRanges) {
  ASSERT_EQ(post("/api/v1/datasets", R"({"name":"means","campaigns":["hall"],"aggregation":"mean"})").status,
            201);
  Call options;
  options.headers["prefer"] = "wait=120";
  const auto means = json(call(api::Method::post, "/api/v1/training-runs",
                               R"({"task":"los_bias","dataset":"means","methods":["constant"],
                                   "cv":{"folds":4,"seed":3},"importance":false})",
                               options));
  const auto manifest = json(get(means.value("model", "")))["manifest"];
  EXPECT_NE(manifest.value("not_for_live", "").find("means"), std::string::npos) << manifest;
  const auto refused = promote(means);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_NE(refused.body.find("not for live"), std::string::npos) << refused.body;
  ASSERT_EQ(promote(means, R"({"reason":"as the dissertation did"})").status, 200);
  // What takes over from it is compared on the thirty single ranges of room 5, fifteen of them LOS.
  const auto single = train("los_bias", "constant");
  const auto gate = json(get(single.value("model", "") + "/gate"));
  ASSERT_FALSE(gate["checks"].empty()) << gate;
  EXPECT_EQ(gate["checks"][0]["name"], "mae_m");
  EXPECT_EQ(gate["checks"][0]["basis"], "held_out");
  EXPECT_FALSE(gate["checks"][0]["current"].is_null()) << gate;
  EXPECT_TRUE(json(get(single.value("model", "")))["manifest"]["not_for_live"].is_null());
}

TEST_F(LearningService, ByDefaultADataSetKeepsSingleRanges) {
  const auto made = post("/api/v1/datasets", R"({"name":"all","campaigns":["hall"]})");
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["train"], 180);
}

TEST_F(LearningService, OneOfEightPromotionsAndRollbacksOfOneStateIsMade) {
  const auto run = train("los_bias", "constant");
  const auto together = [&](const std::string& path, const std::string& body, const std::string& if_match) {
    std::vector<int> status(8);
    std::vector<std::jthread> threads;
    for (auto& one : status) {
      threads.emplace_back([&] {
        Call options;
        if (!if_match.empty()) options.headers["if-match"] = if_match;
        one = call(api::Method::post, path, body, options).status;
      });
    }
    threads.clear();
    return status;
  };
  const auto none = train("los_bias", "none");
  ASSERT_EQ(promote(none, R"({"reason":"something to go back to"})").status, 200);
  const auto promoted = together(run.value("model", "") + "/promote", R"({"reason":"now"})", "");
  EXPECT_EQ(std::ranges::count(promoted, 200), 1) << ::testing::PrintToString(promoted);
  for (const int one : promoted) EXPECT_TRUE(one == 200 || one == 409 || one == 422) << one;
  EXPECT_EQ(json(get("/api/v1/models/promotions"))["items"].size(), 2u);
  // Two presses of one button are one rollback where the client says what it saw.
  const auto seen = header(get("/api/v1/models/active"), "ETag");
  const auto back = together("/api/v1/models/rollback", R"({"task":"los_bias"})", seen);
  EXPECT_EQ(std::ranges::count(back, 200), 1) << ::testing::PrintToString(back);
  for (const int one : back) EXPECT_TRUE(one == 200 || one == 409 || one == 412) << one;
  EXPECT_EQ("/api/v1/models/" + json(get("/api/v1/models/active"))["models"]["los_bias"].value("id", ""),
            none["model"]);
}

TEST_F(LearningService, APromotionWhoseAnswerWasLostBehindItsCommitIsActive) {
  ASSERT_EQ(promote(train("los_bias", "constant"), R"({"reason":"first"})").status, 200);
  const auto second = train("los_bias", "none");
  Promotion lost;
  lost.task = "los_bias";
  lost.model = ModelId{parse_uuid(second.value("model", "").substr(15)).value()};
  lost.time = clock_.now();
  ASSERT_TRUE(database_->stores().models.promote(lost, 1));
  const auto answer = get("/api/v1/models/active");
  EXPECT_EQ(header(answer, "ETag"), "\"m-2\"");
  EXPECT_EQ("/api/v1/models/" + json(answer)["models"]["los_bias"].value("id", ""), second["model"])
      << "the ETag is of this promotion, and the body of the one before";
}

/// Artifacts that left the server, and what comes back.
class SignedModels : public LearningService {
 protected:
  void SetUp() override {
    LearningService::SetUp();
    run_ = train("los_bias", "constant");
    path_ = run_.value("model", "");
    exported_ = Json::parse(get(path_ + "/artifact").body);
    ASSERT_TRUE(exported_.contains("signature")) << exported_.dump().substr(0, 300);
  }
  /// The correction is another one, the figures it claims are the old ones.
  Json edited() const {
    Json out = exported_;
    for (const char* key : {"fallback_m", "min_m", "max_m"})
      out["regressor"][key] = out["regressor"][key].get<double>() + 0.6;
    auto& scorer = out["regressor"]["scorer"];
    const char* offset = scorer.contains("offset") ? "offset" : "base";
    if (scorer.contains(offset)) scorer[offset] = scorer[offset].get<double>() + 0.6;
    return out;
  }
  api::Response upload(const Json& artifact) { return post("/api/v1/models", artifact.dump()); }
  api::Response promote_id(const std::string& id, const std::string& body = "") {
    return post("/api/v1/models/" + id + "/promote", body);
  }
  Json run_, exported_;
  std::string path_;
};

TEST_F(SignedModels, AnEditedArtifactIsRefusedAtTheDoor) {
  const auto refused = upload(edited());
  EXPECT_EQ(refused.status, 422);
  EXPECT_NE(refused.body.find("artifact was changed"), std::string::npos) << refused.body;
}

TEST_F(SignedModels, AManifestFromElsewhereIsNotBelievedButMeasuredHere) {
  Json foreign = edited();
  foreign.erase("signature");
  const auto made = upload(foreign);
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["standing"], "foreign");
  const auto id = json(made).value("id", "");
  const auto refused = promote_id(id);
  EXPECT_EQ(refused.status, 422) << refused.body;
  const auto gate = json(get("/api/v1/models/" + id + "/gate"));
  EXPECT_EQ(gate["passed"], false);
  EXPECT_EQ(gate["checks"][0]["basis"], "kept_data") << gate;
  EXPECT_TRUE(json(get("/api/v1/models/active"))["models"]["los_bias"].is_null());
  // A calibration does not take it by the back door either.
  EXPECT_EQ(post("/api/v1/calibrations",
                 R"({"missions":[")" + mission() + R"("],"models":{"los_bias":")" + id + "\"}}")
                .status,
            422);
  // By a person's word, which is an event and in the audit log.
  ASSERT_EQ(promote_id(id, R"({"reason":"measured by hand"})").status, 200);
  EXPECT_NE(get("/api/v1/events").body.find("model.override"), std::string::npos);
  EXPECT_NE(get("/api/v1/audit").body.find("measured by hand"), std::string::npos);
  EXPECT_EQ(json(get("/api/v1/models/" + id))["standing"], "vouched");
}

TEST_F(SignedModels, AGoodOneFromElsewherePassesOnWhatIsKeptHere) {
  Json foreign = exported_;
  foreign["signature"] = "made:0011223344556677:" + std::string(128, 'a');  // another server's
  foreign["manifest"]["metrics"]["mae_m"] = 9.0;                            // whatever it claims
  const auto made = upload(foreign);
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["standing"], "foreign");
  const auto done = promote_id(json(made).value("id", ""));
  EXPECT_EQ(done.status, 200) << done.body;
  EXPECT_EQ(json(done)["gate"]["checks"][0]["basis"], "kept_data");
}

TEST_F(SignedModels, ExportAndImportOnTheSameServerKeepTheStanding) {
  const auto made = upload(exported_);
  ASSERT_EQ(made.status, 201) << made.body;
  EXPECT_EQ(json(made)["standing"], "made");
  EXPECT_EQ(promote_id(json(made).value("id", "")).status, 200);
}

TEST_F(SignedModels, WithoutKeptDataOnlyAReasonPromotesWhatIsFromElsewhere) {
  Json foreign = exported_;
  foreign.erase("signature");
  foreign["manifest"]["features"] = Json::array({"std_noise"});  // nothing kept here has it
  const auto made = upload(foreign);
  if (made.status == 201) {
    const auto gate = json(get("/api/v1/models/" + json(made).value("id", "") + "/gate"));
    EXPECT_EQ(gate["passed"], false) << gate;
    EXPECT_EQ(gate["checks"][0]["basis"], "none") << gate;
  } else {
    EXPECT_EQ(made.status, 422) << made.body;  // a constant needs no feature, and may name none
  }
}

TEST_F(SignedModels, AnArtifactEditedInTheDatabaseIsNotUsedAndSaysSo) {
  ASSERT_EQ(promote(run_).status, 200);
  ASSERT_FALSE(json(get("/api/v1/models/active"))["raw"]);
  app_.reset();
  database_.reset();
  Json bytes = edited();
  bytes.erase("signature");
  {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open((dir_ / "data" / "anchord.db").c_str(), &db), SQLITE_OK);
    sqlite3_stmt* change = nullptr;
    ASSERT_EQ(sqlite3_prepare_v2(db, "UPDATE model_artifact SET json = ?1", -1, &change, nullptr), SQLITE_OK);
    const std::string text = bytes.dump();
    sqlite3_bind_text(change, 1, text.c_str(), -1, SQLITE_TRANSIENT);
    EXPECT_EQ(sqlite3_step(change), SQLITE_DONE);
    sqlite3_finalize(change);
    sqlite3_close(db);
  }
  open();
  const auto active = json(get("/api/v1/models/active"));
  EXPECT_EQ(active["raw"], true);
  EXPECT_NE(active.value("note", "").find("artifact was changed"), std::string::npos) << active;
  EXPECT_NE(get("/api/v1/events").body.find("model.refused"), std::string::npos);
  EXPECT_EQ(json(get(path_))["standing"], "changed");
  EXPECT_EQ(get(path_ + "/artifact").status, 409);
  EXPECT_EQ(post(path_ + "/promote", R"({"reason":"never mind"})").status, 409) << "no reason is good enough";
  EXPECT_EQ(post(path_ + "/predict", R"({"sample":{"distance_m":6}})").status, 422);
}

TEST_F(LearningService, APromotionIsAnEventOfTheRecordAndSurvivesARestart) {
  const auto mission =
      json(post("/api/v1/missions", R"({"name":"flight","frame":"local","track_point":"tag_antenna",
    "tags":[{"tag":"0x6e01","lever_arm_body_m":[0,0,0]}]})"));
  const auto run = train("nlos_id", "logistic");
  ASSERT_EQ(promote(run).status, 200);
  const auto told = [&](const std::string& path) {
    std::vector<std::string> texts;
    const auto events = json(get(path));
    for (const auto& event : events["items"])
      if (event["code"] == "model.promoted") texts.push_back(event.value("text", ""));
    return texts;
  };
  const std::string flight = "/api/v1/missions/" + mission.value("id", "") + "/events";
  const auto live = told("/api/v1/events");
  ASSERT_EQ(live.size(), 2u) << mission;  // once for all, once for the flight that was recording
  ASSERT_EQ(told(flight).size(), 1u);
  restart();
  EXPECT_EQ(told("/api/v1/events"), std::vector<std::string>{live.front()})
      << "that of the flight is with it";
  EXPECT_EQ(told(flight), std::vector<std::string>{live.front()});
  EXPECT_EQ("/api/v1/models/" + json(get("/api/v1/models/active"))["models"]["nlos_id"].value("id", ""),
            run["model"]);
}

TEST_F(LearningService, GivesTheImpulseResponseOfASample) {
  const auto line = R"({"setting":"s","environment":"lab","true_distance_m":4.9,"los":true,"range_m":5,)"
                    R"("cir":{"n":2,"dt_ps":1001.6,"first_path_idx":1,"rxpacc":900,"b64":"AQACAP//BAA="}})";
  const auto sent = post("/api/v1/campaigns/hall/samples", line, "application/x-ndjson");
  ASSERT_EQ(json(sent)["accepted"], 1) << sent.body;
  const auto samples = json(get("/api/v1/campaigns/hall/samples", {{"environment", "lab"}}))["items"];
  ASSERT_EQ(samples.size(), 1u);
  EXPECT_EQ(samples[0]["has_cir"], true);
  const auto path = "/api/v1/campaigns/hall/samples/" + samples[0]["id"].dump() + "/cir";
  const auto cir = get(path);
  ASSERT_EQ(cir.status, 200) << cir.body;
  EXPECT_EQ(json(cir)["b64"], "AQACAP//BAA=");
  EXPECT_EQ(json(cir)["first_path_idx"], 1);
  EXPECT_EQ(get(path, {{"format", "binary"}}).body, std::string("\1\0\2\0\xFF\xFF\4\0", 8));
  EXPECT_EQ(get("/api/v1/campaigns/hall/samples/1/cir").status, 404);
  EXPECT_EQ(get("/api/v1/campaigns/hall/samples/none/cir").status, 404);
}

TEST_F(LearningService, NamesTheMethodsThatCanDoATask) {
  const auto wrong =
      post("/api/v1/training-runs", R"({"task":"bias","dataset":"set","methods":["logistic"]})");
  ASSERT_EQ(wrong.status, 422) << wrong.body;
  EXPECT_EQ(json(wrong)["errors"][0]["pointer"], "/methods/0");
  EXPECT_NE(json(wrong)["errors"][0].value("detail", "").find("multivariate"), std::string::npos)
      << wrong.body;
}

TEST_F(LearningService, AModelThatLiveRangesCannotFeedIsNotPromoted) {
  auto csv = get("/api/v1/datasets/set/rows", {{"format", "csv"}}).body;
  std::string with_register;
  for (std::size_t at = 0, line = 0; at < csv.size(); ++line) {
    const auto end = csv.find('\n', at);
    with_register +=
        csv.substr(at, end - at) + (line == 0 ? ",fp_amp1" : "," + std::to_string(9000 + line % 7)) + "\n";
    at = end + 1;
  }
  ASSERT_EQ(post("/api/v1/datasets", with_register, "text/csv", {{"name", "registers"}}).status, 201);
  Call options;
  options.headers["prefer"] = "wait=120";
  const auto run = json(call(
      api::Method::post, "/api/v1/training-runs",
      R"({"task":"nlos_id","dataset":"registers","methods":["logistic"],"features":["rx_dbm","fp_dbm","fp_amp1"],
                             "cv":{"folds":4},"importance":false})",
      options));
  const auto refused = promote(run);
  EXPECT_EQ(refused.status, 422) << refused.body;
  EXPECT_NE(json(refused).value("detail", "").find("fp_amp1"), std::string::npos) << refused.body;
  EXPECT_EQ(json(get("/api/v1/models/active"))["raw"], true);
}

// What a person noted of a place is in every campaign row, and in no range of a flight.
TEST_F(LearningService, AModelOfWhatAPersonNotedIsRefusedByTheNameOfTheFeature) {
  auto csv = campaign_csv();
  std::string noted;
  for (std::size_t at = 0, line = 0; at < csv.size(); ++line) {
    const auto end = csv.find('\n', at);
    noted += csv.substr(at, end - at) +
             (line == 0       ? ",height_difference_m"
              : line % 2 == 0 ? ",1.5"
                              : ",1.5") +
             "\n";
    at = end + 1;
  }
  ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"noted"})").status, 201);
  ASSERT_EQ(post("/api/v1/campaigns/noted/samples", noted, "text/csv").status, 200);
  ASSERT_EQ(post("/api/v1/datasets", R"({"name":"noted","campaigns":["noted"]})").status, 201);
  const auto trained = [&](const std::string& features) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return json(call(api::Method::post, "/api/v1/training-runs",
                     R"({"task":"nlos_id","dataset":"noted","methods":["logistic"],)" + features +
                         R"("cv":{"folds":4},"importance":false})",
                     options));
  };
  const auto run = trained(R"("features":["rx_dbm","fp_dbm","height_difference_m"],)");
  for (const auto* body : {"", R"({"reason":"never mind"})"}) {
    const auto refused = promote(run, body);
    EXPECT_EQ(refused.status, 422) << refused.body;
    EXPECT_NE(refused.body.find("height_difference_m"), std::string::npos) << refused.body;
  }
  // Where nothing is named, nothing is taken that flights lack.
  EXPECT_EQ(promote(trained("")).status, 200);
}

TEST_F(LearningService, PredictsAndSaysWhatASampleLacks) {
  const auto sample = R"({"sample":{"distance_m":6,"rx_dbm":-81,"fp_dbm":-83}})";
  EXPECT_EQ(json(post("/api/v1/models/active/predict", sample))["note"], "no model is promoted");
  const auto run = train("nlos_id", "logistic");
  ASSERT_EQ(promote(run).status, 200);
  const auto judged = json(post("/api/v1/models/active/predict", sample));
  const std::string registers =
      R"("cir_power":11855,"preamble_count":611,"fp_amp1":18712,"fp_amp2":10250,"fp_amp3":11576)";
  const auto p_los = [&](const std::string& more) {
    return json(
        post("/api/v1/models/active/predict", R"({"sample":{"distance_m":6,)" + more + "}}"))["p_los"];
  };
  EXPECT_EQ(p_los(registers + R"(,"rx_dbm":-70,"fp_dbm":-72)"), p_los(registers))
      << "as in training, levels are those of the registers where both are given";
  EXPECT_EQ(judged["los"], true);
  EXPECT_GT(judged["p_los"], 0.5);
  EXPECT_EQ("/api/v1/models/" + judged["models"].value("nlos_id", ""), run["model"]);
  EXPECT_EQ(judged["models"].size(), 1u);
  const auto batch =
      json(post(run.value("model", "") + "/predict",
                R"({"samples":[{"distance_m":6,"rx_dbm":-81,"fp_dbm":-89},{"distance_m":6}]})"));
  EXPECT_EQ(batch["items"][0]["los"], false);
  EXPECT_TRUE(batch["items"][1]["p_los"].is_null());
  EXPECT_NE(batch["items"][1].value("note", "").find("fp_dbm"), std::string::npos) << batch;
  EXPECT_EQ(post("/api/v1/models/active/predict", R"({"sample":{"fp_dmb":1}})").status, 422);
}

TEST_F(LearningService, TellsWhatThePlainRulesAreWorth) {
  const auto answer = get("/api/v1/datasets/set/rules");
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto rules = json(answer);
  EXPECT_EQ(rules["los_rows"], 90);
  // 2 dB and 8 dB between total and first path: the printed threshold of 6 dB separates them.
  EXPECT_GT(rules["printed"]["first_path"]["los_rate"], 0.95);
  EXPECT_GT(rules["fitted"]["first_path"]["nlos_rate"], 0.9);
  EXPECT_FALSE(rules["fitted"].contains("kurtosis"));  // no impulse responses here
  EXPECT_EQ(get("/api/v1/datasets/set/rules", {{"group_by", "moon"}}).status, 422);
}

TEST_F(LearningService, DerivesAnOldFlightAgainWithTheModelsAskedFor) {
  sim::SimulationOptions simulated;
  simulated.seed = 5;
  simulated.range_rate_hz = 8;
  auto flight = sim::simulate_flight(sim::demonstration_world(), simulated).value();
  Mission mission = flight.data.mission;
  mission.id.uuid = make_uuid_v7(clock_.now());
  mission.created = clock_.now();
  ASSERT_TRUE(database_->stores().missions.insert(mission).has_value());
  for (auto& range : flight.data.ranges) range.mission = mission.id;
  for (auto& fix : flight.data.fixes) fix.mission = mission.id;
  ASSERT_TRUE(database_->stores().measurements.append_fixes(flight.data.fixes, true).has_value());
  ASSERT_TRUE(database_->stores().measurements.append_ranges(flight.data.ranges, true).has_value());
  const auto solve = [&](const std::string& more) {
    Call options;
    options.headers["prefer"] = "wait=120";
    return call(api::Method::post, "/api/v1/calibrations",
                R"({"missions":[")" + to_string(mission.id) + "\"]" + more + "}", options);
  };
  const auto before = json(solve(""));
  EXPECT_TRUE(before["provenance"]["models"].is_null()) << before["provenance"];

  Call options;
  options.headers["prefer"] = "wait=120";
  const auto run = json(call(api::Method::post, "/api/v1/training-runs",
                             R"({"task":"bias","dataset":"set","methods":["constant"],"features":["range_m"],
                             "cv":{"folds":4,"seed":3},"importance":false})",
                             options));
  ASSERT_EQ(promote(run, R"({"reason":"made-up numbers"})").status, 200) << run;
  const auto with = json(solve(""));
  const auto& told = with["provenance"]["models"];
  ASSERT_TRUE(told.is_object()) << with["provenance"];
  EXPECT_EQ("/api/v1/models/" + told.value("bias", ""), run["model"]);
  EXPECT_GT(told["flights"][0]["n_corrected"], 100);
  // The same flight without the model is kept beside, as it was solved before.
  ASSERT_EQ(with["provenance"]["uncorrected"].size(), before["anchors"].size());
  const auto without = json(solve(R"(,"models":{"bias":"none"})"));
  EXPECT_TRUE(without["provenance"]["models"].is_null());
  EXPECT_EQ(without["anchors"].size(), before["anchors"].size());
  EXPECT_EQ(solve(R"(,"models":{"bias":"0197b0ff-0000-7000-8000-000000000000"})").status, 422);
  EXPECT_EQ(solve(R"(,"models":{"bias":"newest"})").status, 422);
  // Ranges that were recorded keep what they were.
  EXPECT_EQ(json(get("/api/v1/ranges",
                     {{"mission", to_string(mission.id)}, {"limit", "1"}}))["items"][0]["distance_m"],
            flight.data.ranges.front().distance_m);
}

TEST_F(LearningService, KeepsRolesApart) {
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(api::Method::get, "/api/v1/models", "", viewer).status, 200);
  EXPECT_EQ(call(api::Method::post, "/api/v1/training-runs", "{}", viewer).status, 403);
  Call gateway;
  gateway.roles = {api::Role::gateway};
  EXPECT_EQ(call(api::Method::post, "/api/v1/campaigns", R"({"name":"from the field"})", gateway).status,
            201);
  EXPECT_EQ(call(api::Method::post, "/api/v1/datasets", "{}", gateway).status, 403);
}

}  // namespace
}  // namespace anchord::test::service_test
