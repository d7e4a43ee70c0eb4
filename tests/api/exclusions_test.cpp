// A person takes measurements out of use, with a reason, and back: stored as rows of their own, audited,
// applied to the live flight at once and named by every calibration after.
#include <barrier>
#include <thread>

#include "api/formats/flight_folder.hpp"
#include "api/wire/exclusion_json.hpp"
#include "app_fixture.hpp"
#include "core/ports/exclusion_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test::exclusions_test {
namespace {

using api::Method;

class Exclusions : public AppFixture {
 protected:
  /// A flight on the globe, stored, with every range of the first anchor 3 m too long between 40 and 80 s.
  void SetUp() override {
    AppFixture::SetUp();
    testing::MadeFlight made;
    made.frame = TrackFrame::wgs84;
    made.duration_s = 120;
    flight_ = testing::make_flight(made);
    mission_ = mission();
    const MissionId id{parse_uuid(mission_).value()};
    first_ = flight_.ranges.front().anchor;
    for (auto& fix : flight_.fixes) fix.mission = id, fix.time.ns += k_start_ns;
    for (auto& range : flight_.ranges) {
      range.mission = id;
      range.time.ns += k_start_ns;
      const double t_s = range.time.seconds() - k_start_ns * 1e-9;
      if (range.anchor == first_ && t_s >= 40 && t_s < 80) range.distance_m += 3;
    }
    ASSERT_TRUE(database_->stores().measurements.append_fixes(flight_.fixes, true).has_value());
    ASSERT_TRUE(database_->stores().measurements.append_ranges(flight_.ranges, true).has_value());
  }
  std::string path() const { return "/api/v1/missions/" + mission_ + "/exclusions"; }
  static std::int64_t us(double t_s) { return k_start_ns / 1000 + static_cast<std::int64_t>(t_s * 1e6); }
  Json exclude(const std::string& body) {
    const auto made = post(path(), body);
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made);
  }
  std::string span(double from_s, double to_s, const std::string& reason = "a crane stood in the way") const {
    return R"({"kind":"ranges","anchor":")" + to_string(first_) + R"(","since":)" +
           std::to_string(us(from_s)) + R"(,"until":)" + std::to_string(us(to_s)) + R"(,"reason":")" +
           reason + "\"}";
  }
  Json solve() {
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto done =
        call(Method::post, "/api/v1/calibrations", R"({"missions":[")" + mission_ + "\"]}", options);
    EXPECT_EQ(done.status, 201) << done.body;
    return json(done);
  }
  /// Why gate `outdated` of a calibration fails today; empty where it is not asked.
  std::string outdated(const Json& calibration) {
    const auto today = json(get("/api/v1/calibrations/" + calibration.value("id", "")));
    for (const auto& gate : today["anchors"][0]["quality"]["gates"])
      if (gate["name"] == "outdated" && gate["passed"] == false) return gate["why"];
    return "";
  }
  Json live(const NetworkId& id) {
    const auto all =
        get("/api/v1/anchors", {{"view", "live"}, {"mission", mission_}});  // reads the stored rows in
    EXPECT_EQ(all.status, 200) << all.body;
    const auto answer = get("/api/v1/anchors/" + to_string(id) + "/estimates", {{"mission", mission_}});
    EXPECT_EQ(answer.status, 200) << answer.body;
    const auto items = json(answer).value("items", Json::array());
    return items.empty() ? Json() : items[0];
  }
  static constexpr std::int64_t k_start_ns = 1'777'889'472'000'000'000;
  FlightData flight_;
  std::string mission_;
  NetworkId first_{};
};

TEST_F(Exclusions, AreOfRowsThatExistWithAReasonAndInOneWay) {
  for (const char* body : {R"({"kind":"ranges","reason":"why"})", R"({"kind":"ranges","ids":[1]})",
                           R"({"kind":"ranges","ids":[1],"since":5,"reason":"both"})",
                           R"({"kind":"ranges","ids":[99999999],"reason":"no row"})",
                           R"({"kind":"ranges","since":5,"until":6,"reason":"long ago"})",
                           R"({"kind":"ranges","since":9,"until":6,"reason":"turned"})",
                           R"({"kind":"fixes","anchor":"0x1","since":5,"reason":"of no anchor"})",
                           R"({"kind":"ranges","ids":[1],"reason":"  "})"}) {
    EXPECT_EQ(post(path(), body).status, 422) << body;
  }
  EXPECT_TRUE(json(get(path()))["items"].empty());
  Call viewer;
  viewer.roles = {api::Role::viewer};
  EXPECT_EQ(call(Method::post, path(), span(40, 80), viewer).status, 403);
  EXPECT_EQ(call(Method::get, path(), "", viewer).status, 200);
  EXPECT_EQ(post("/api/v1/missions/0197b0ff-0000-7000-8000-000000000000/exclusions", span(40, 80)).status,
            404);
}

TEST_F(Exclusions, AreStoredAuditedAndTakenBackOnceByOneOfEight) {
  const auto made = exclude(span(40, 80));
  EXPECT_GT(made["n_rows"].get<int>(), 50);
  restart();
  const auto kept = json(get(path()))["items"];
  ASSERT_EQ(kept.size(), 1u);
  EXPECT_EQ(kept[0], made);
  EXPECT_NE(get("/api/v1/audit").body.find("a crane stood in the way"), std::string::npos);
  std::vector<int> status(8);
  {
    std::vector<std::jthread> threads;
    for (auto& one : status)
      threads.emplace_back([&] {
        one = post(path() + "/" + made.value("id", "") + "/include", R"({"reason":"it was a bird"})").status;
      });
  }
  EXPECT_EQ(std::ranges::count(status, 200), 1) << ::testing::PrintToString(status);
  EXPECT_EQ(std::ranges::count(status, 409), 7) << ::testing::PrintToString(status);
  EXPECT_EQ(json(get(path()))["items"][0]["included"]["reason"], "it was a bird");
  // What was measured is as it was.
  EXPECT_EQ(database_->stores().measurements.count_ranges(MissionId{parse_uuid(mission_).value()}).value(),
            flight_.ranges.size());
}

TEST_F(Exclusions, ACalibrationLeavesThemOutAndNamesThem) {
  const auto before = solve();
  EXPECT_TRUE(before["provenance"]["flights"][0]["exclusions"]["items"].empty());
  const auto made = exclude(span(40, 80));
  const auto after = solve();
  const auto& told = after["provenance"]["flights"][0]["exclusions"];
  ASSERT_EQ(told["items"].size(), 1u) << told;
  EXPECT_EQ(told["items"][0]["id"], made["id"]);
  EXPECT_EQ(told["items"][0]["reason"], "a crane stood in the way");
  EXPECT_EQ(told["sha256"].get<std::string>().size(), 64u);
  EXPECT_EQ(after["provenance"]["flights"][0]["refused"]["excluded"], made["n_rows"]);
  EXPECT_EQ(outdated(after), "");
  const std::string name = json(get("/api/v1/missions/" + mission_))["name"];
  EXPECT_EQ(outdated(before),
            "exclusions of flight \"" + name + "\": changed since it was solved; solve again");
  const auto refused = post("/api/v1/calibrations/" + before.value("id", "") + "/publish", "{}");
  EXPECT_EQ(refused.status, 409) << refused.body;
  EXPECT_NE(refused.body.find("outdated"), std::string::npos) << refused.body;
  ASSERT_EQ(post(path() + "/" + made.value("id", "") + "/include", "{}").status, 200);
  EXPECT_EQ(outdated(before), "") << "as it was solved";
  EXPECT_NE(outdated(after), "");
  const auto again = solve();
  EXPECT_TRUE(again["provenance"]["flights"][0]["exclusions"]["items"].empty());
  EXPECT_FALSE(again["provenance"]["flights"][0]["refused"].contains("excluded"));
  EXPECT_EQ(again["anchors"], before["anchors"]);
}

TEST_F(Exclusions, TheLiveFlightAppliesThemAtOnce) {
  restart();  // a live flight of what is stored
  const auto before = live(first_);
  ASSERT_TRUE(before.is_object() && before.contains("n_ranges")) << before;
  const auto made = exclude(span(40, 80));
  const auto after = live(first_);
  ASSERT_TRUE(after.is_object() && after.contains("n_ranges")) << after;
  EXPECT_EQ(after["n_ranges"].get<int>() + made["n_rows"].get<int>(), before["n_ranges"].get<int>()) << after;
  // What comes later within an open span is left out too.
  exclude(R"({"kind":"ranges","anchor":")" + to_string(first_) + R"(","since":)" + std::to_string(us(100)) +
          R"(,"reason":"taken down"})");
  const int n = live(first_)["n_ranges"].get<int>();
  const auto sent = post("/api/v1/ranges",
                         R"({"t_us":)" + std::to_string(us(110.0005)) + R"(,"tag":")" +
                             to_string(flight_.ranges.front().tag) + R"(","anchor":")" + to_string(first_) +
                             "\",\"distance_m\":7.5}\n",
                         "application/x-ndjson", {{"mission", mission_}});
  ASSERT_EQ(json(sent)["accepted"], 1) << sent.body;
  EXPECT_EQ(live(first_)["n_ranges"].get<int>(), n);
}

TEST_F(Exclusions, PositionsAndSingleRowsToo) {
  const auto ranges = json(get("/api/v1/ranges", {{"mission", mission_}, {"limit", "3"}}))["items"];
  const auto rows = exclude(R"({"kind":"ranges","ids":[)" + ranges[0]["id"].dump() + "," +
                            ranges[2]["id"].dump() + R"(],"reason":"two birds"})");
  EXPECT_EQ(rows["n_rows"], 2);
  EXPECT_EQ(rows["rows"].size(), 2u);
  const auto fixes = exclude(R"({"kind":"fixes","since":)" + std::to_string(us(10)) + R"(,"until":)" +
                             std::to_string(us(12)) + R"(,"reason":"under the bridge"})");
  const auto solved = solve();
  EXPECT_EQ(solved["provenance"]["flights"][0]["fixes_refused"]["excluded"], fixes["n_rows"]);
  EXPECT_EQ(solved["provenance"]["flights"][0]["refused"]["excluded"], 2);
}

TEST_F(Exclusions, AFlightFolderCarriesThem) {
  exclude(span(40, 80));
  const auto back = exclude(span(5, 6, "a bird"));
  ASSERT_EQ(post(path() + "/" + back.value("id", "") + "/include", "{}").status, 200);
  FlightData whole = flight_;
  whole.exclusions =
      database_->stores().exclusions.exclusions(MissionId{parse_uuid(mission_).value()}).value();
  whole.mission = database_->stores().missions.mission(MissionId{parse_uuid(mission_).value()}).value();
  ASSERT_TRUE(write_flight_folder(whole, dir_ / "folder").has_value());
  auto read = read_flight_folder(dir_ / "folder");
  ASSERT_TRUE(read.has_value()) << read.error().message;
  FlightData& flight = read.value();
  ASSERT_EQ(flight.exclusions.size(), 2u);
  EXPECT_EQ(flight.exclusions[0].reason, "a crane stood in the way");
  EXPECT_TRUE(flight.exclusions[0].applies());
  EXPECT_FALSE(flight.exclusions[1].applies());
  const std::size_t n = flight.ranges.size();
  leave_out_excluded(flight);
  EXPECT_EQ(n - flight.ranges.size(), whole.exclusions[0].n_rows);
  EXPECT_EQ(flight.n_ranges_excluded.at(first_), whole.exclusions[0].n_rows);
}

TEST_F(Exclusions, AFileOfThemThatIsWrongIsNamedByItsPlace) {
  for (const char* text :
       {"", "{}", R"({"schema":"anchord.exclusions/1","exclusions":[{"kind":"ranges"}]})",
        R"({"schema":"anchord.exclusions/1","exclusions":[{"kind":"ranges","ids":[1],"reason":"x"}]})"}) {
    const auto read = parse_exclusions_file(text);
    ASSERT_FALSE(read) << text;
    EXPECT_EQ(read.error().code, Errc::invalid_argument);
  }
}

}  // namespace
}  // namespace anchord::test::exclusions_test
