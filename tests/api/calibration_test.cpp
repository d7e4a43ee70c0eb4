// What a calibration may be asked for, each shown to have an effect: the likelihood of a model, stated noise,
// starts, a local frame, ranges between anchors, the site's outline.
#include <set>

#include "api/calibration/calibration_service.hpp"
#include "calibrations_fixture.hpp"

namespace anchord::test::calibration_test {
namespace {

TEST_F(Calibrations, ALikelihoodThatKnowsBlockedPathsAreLateBeatsTheLoss) {
  promote_mixture();
  double one_sided_m = 0, loss_m = 0, raw_m = 0;
  constexpr int k_flights = 3;
  for (std::uint64_t seed = 1; seed <= k_flights; ++seed) {
    const MadeFlight m = made(seed);
    const auto mission = flown(m, 0.35);
    const auto with = solved(mission);
    const auto& told = with["provenance"]["models"];
    EXPECT_EQ(told["likelihood"], "one_sided");
    EXPECT_GT(told["flights"][0]["n_believed"], 0.8 * told["flights"][0]["n_ranges"].get<double>()) << told;
    EXPECT_NE(with["provenance"]["flights"][0]["notes"].dump().find("likelihood of a model"),
              std::string::npos);
    one_sided_m += error_m(with, m) / k_flights;
    const auto without = solved(mission, {{"models", {{"likelihood", "loss"}}}});
    EXPECT_EQ(without["provenance"]["models"]["likelihood"], "loss");
    EXPECT_EQ(without["provenance"]["models"]["flights"][0]["n_believed"], 0);
    loss_m += error_m(without, m) / k_flights;
    raw_m += error_m(solved(mission, {{"models", {{"bias", "none"}}}}), m) / k_flights;
  }
  std::printf("35 %% blocked: anchors off by %.3f m with the likelihood, %.3f m with the loss, %.3f m raw\n",
              one_sided_m, loss_m, raw_m);
  EXPECT_LT(one_sided_m, loss_m);
  EXPECT_LT(one_sided_m, raw_m);
}

TEST_F(Calibrations, StatedNoiseOfBlockedRangesCountsAndSaysOnHowMany) {
  promote_mixture();
  const auto mission = flown(made(4), 0.3);
  const auto narrow = solved(mission, {{"sigma_m", {{"los", 0.049}, {"nlos", 0.234}, {"rtk", 0.02}}}});
  const auto wide = solved(mission, {{"sigma_m", {{"los", 0.049}, {"nlos", 5.0}, {"rtk", 0.02}}}});
  const auto& told = narrow["provenance"]["sigma_m"];
  EXPECT_EQ(told["nlos"], 0.234);
  EXPECT_GT(told["n_nlos_applied"], 1000);
  EXPECT_NE(narrow["anchors"][0]["enu_m"], wide["anchors"][0]["enu_m"]);
  // Without a model no range is known to be blocked, and the provenance says so.
  const auto none = solved(mission, {{"sigma_m", {{"nlos", 0.234}}}, {"models", {{"bias", "none"}}}});
  EXPECT_EQ(none["provenance"]["sigma_m"]["n_nlos_applied"], 0);
}

TEST_F(Calibrations, BeginWhereTheyAreTold) {
  MadeFlight flat = made(5);
  flat.height_swing_m = 0;  // one plane at 6 m: every anchor has a mirror solution above or below
  flat.anchors = {{12, 2, 2}, {-10, 8, 2.5}, {3, -14, 2}, {-6, -9, 1.5}};
  const auto mission = flown(flat);
  const auto origin = solved(mission)["origin"];
  const auto begun = [&](double up_m) {
    Json starts = Json::object();
    const EnuFrame frame(
        {origin["lat"].get<double>(), origin["lon"].get<double>(), origin["h_m"].get<double>()});
    const EnuFrame truth(flat.origin);
    for (std::size_t i = 0; i < flat.anchors.size(); ++i) {
      Eigen::Vector3d at = flat.anchors[i];
      at.z() = up_m;
      const auto enu = frame.enu_from_wgs84(truth.wgs84_from_enu({at})).m;
      starts[to_string(NetworkId{static_cast<std::uint32_t>(0x6000 + i)})] = {enu.x(), enu.y(), enu.z()};
    }
    return solved(mission, {{"initial", starts}})["anchors"];
  };
  const auto low = begun(2), high = begun(10);
  for (std::size_t i = 0; i < low.size(); ++i) {
    // Which mirror solution is told first follows the start; that there are two is told either way.
    EXPECT_GT(high[i]["enu_m"][2].get<double>() - low[i]["enu_m"][2].get<double>(), 2.0) << i;
    EXPECT_EQ(low[i]["verdict"], "ambiguous");
  }
  EXPECT_EQ(solve(mission, {{"initial", "anywhere"}}).status, 422);
  EXPECT_EQ(solve(mission, {{"initial", {{"0x6000", {1, 2}}}}}).status, 422);
  EXPECT_EQ(solve(mission, {{"initial", 3}}).status, 422);
}

// Priors so weak that as priors they weigh nothing (half the squared misfit is below 0.004): what follows
// them is where the search begins, and nothing else.
TEST_F(Calibrations, BeginWhereBearingAndHeightMeet) {
  MadeFlight flat = made(11);
  flat.height_swing_m = 0;  // one plane at 6 m: a mirror solution of every anchor 8 to 9 m above it
  flat.anchors = {{12, 2, 2}, {-10, 8, 2.5}, {3, -14, 2}, {-6, -9, 1.5}};
  const auto mission = flown(flat);
  const auto at = solved(mission)["origin"];
  const EnuFrame frame({at["lat"].get<double>(), at["lon"].get<double>(), at["h_m"].get<double>()});
  const EnuFrame truth(flat.origin);
  const auto told = [&](const Eigen::Vector3d& place_m) {
    return frame.enu_from_wgs84(truth.wgs84_from_enu({place_m})).m;
  };
  const auto begun = [&](double up_m, const char* initial) {
    const Eigen::Vector3d turn = told({0, 0, 6});
    Json anchors = Json::object();
    for (std::size_t i = 0; i < flat.anchors.size(); ++i) {
      const Eigen::Vector3d way = told({flat.anchors[i].x(), flat.anchors[i].y(), up_m}) - turn;
      anchors[to_string(NetworkId{static_cast<std::uint32_t>(0x6000 + i)})] = {
          {"bearing",
           {{"from_m", {turn.x(), turn.y(), turn.z()}},
            {"bearing_deg", std::atan2(way.x(), way.y()) * 57.29577951308232},
            {"sigma_deg", 180}}},
          {"height", {{"up_m", turn.z() + way.z()}, {"sigma_m", 100}}}};
    }
    return solved(mission, {{"initial", initial}, {"priors", {{"anchors", anchors}}}})["anchors"];
  };
  const auto low = begun(2, "bearing_height"), high = begun(10, "bearing_height");
  const auto searched = begun(2, "search"), searched_high = begun(10, "search");
  for (std::size_t i = 0; i < low.size(); ++i) {
    const auto up_m = [&](const Json& anchors) { return anchors[i]["enu_m"][2].get<double>(); };
    EXPECT_GT(up_m(high) - up_m(low), 2.0) << i;
    EXPECT_NEAR(up_m(searched), up_m(searched_high), 1.0) << "the priors alone decide nothing";
  }
}

TEST_F(Calibrations, CountAFlightOnceThatIsThereTwiceOfTheSameKitOrAnother) {
  const auto first = flown(made(31)), again = flown(made(31)),
             renamed = flown(made(31), 0, "", "another kit"), second = flown(made(32));
  const auto h95_m = [](const Json& calibration) {
    std::vector<double> out;
    for (const auto& anchor : calibration["anchors"])
      out.push_back(anchor["accuracy"]["relative"]["h95_m"].get<double>());
    return out;
  };
  const auto alone = h95_m(solved(first));
  const auto copies = solved({first, again, renamed}), two = solved({first, second});
  ASSERT_EQ(h95_m(copies).size(), alone.size());
  for (std::size_t i = 0; i < alone.size(); ++i) {
    EXPECT_NEAR(h95_m(copies)[i], alone[i], 1e-6) << "copies are no measurements";
    EXPECT_LT(h95_m(two)[i], 0.9 * alone[i]) << "another flight is";
  }
  const auto& flights = copies["provenance"]["flights"];
  EXPECT_EQ(flights[0]["copy_of"], nullptr);
  EXPECT_EQ(flights[1]["copy_of"], first);
  EXPECT_EQ(flights[2]["copy_of"], first);
}

TEST_F(Calibrations, PublishedBringAnchorsWithoutASiteIntoThatOfTheFlightsAndNameThoseOfAnother) {
  const auto hall = site(square(40)), other = site(square(40));
  const auto publish = [&](const Json& calibration) {
    const auto done = post("/api/v1/calibrations/" + calibration["id"].get<std::string>() + "/publish", "{}");
    EXPECT_EQ(done.status, 201) << done.body;
    return json(done);
  };
  const auto sites_of = [&] {
    std::set<std::string> out;
    const auto all = json(get("/api/v1/anchors"));
    for (const auto& feature : all["features"])
      out.insert(feature["properties"]["site"].is_null() ? "none"
                                                         : feature["properties"]["site"].get<std::string>());
    return out;
  };
  EXPECT_EQ(publish(solved(flown(made(41))))["of_other_sites"], Json::array());
  EXPECT_EQ(sites_of(), std::set<std::string>{"none"}) << "the flight had no site";
  EXPECT_EQ(publish(solved(flown(made(42), 0, hall)))["of_other_sites"], Json::array());
  EXPECT_EQ(sites_of(), std::set<std::string>{hall});
  const auto again = publish(solved(flown(made(43), 0, other)));
  EXPECT_EQ(sites_of(), std::set<std::string>{hall}) << "nothing is taken away";
  ASSERT_EQ(again["of_other_sites"].size(), again["anchors"].size());
  EXPECT_EQ(again["of_other_sites"][0]["site"], hall);
}

TEST_F(Calibrations, TellTheirAnswerInALocalFrameToo) {
  const MadeFlight m = made(6);
  const auto mission = flown(m);
  EXPECT_EQ(solve(mission, {{"frame", "hall-a"}}).status, 422);
  ASSERT_EQ(post("/api/v1/frames", R"({"name":"hall-a"})").status, 201);
  const auto unfitted = solve(mission, {{"frame", "hall-a"}});
  EXPECT_EQ(unfitted.status, 422);
  EXPECT_NE(unfitted.body.find("has not been fitted"), std::string::npos) << unfitted.body;
  // x is north and y is west of a corner at (20, -30) m.
  const EnuFrame frame(m.origin);
  Json pairs = Json::array();
  for (const auto& local : {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(40, 0, 0), Eigen::Vector3d(0, 30, 0)}) {
    const Wgs84 at = frame.wgs84_from_enu({Eigen::Vector3d(20 - local.y(), -30 + local.x(), 0)});
    pairs.push_back({{"name", "p"},
                     {"local_m", {local.x(), local.y(), local.z()}},
                     {"lon", at.lon_deg},
                     {"lat", at.lat_deg},
                     {"h_m", at.height_m}});
  }
  const auto fit = post("/api/v1/frames/hall-a/fit", Json{{"parameters", 4}, {"pairs", pairs}}.dump());
  ASSERT_EQ(fit.status, 200) << fit.body;
  const auto answer = solved(mission, {{"frame", "hall-a"}});
  EXPECT_EQ(answer["provenance"]["frame"]["name"], "hall-a");
  for (std::size_t i = 0; i < m.anchors.size(); ++i) {
    const auto& local = answer["anchors"][i]["local_m"];
    EXPECT_NEAR(local[0].get<double>(), m.anchors[i].y() + 30, 0.2);
    EXPECT_NEAR(local[1].get<double>(), 20 - m.anchors[i].x(), 0.2);
  }
  EXPECT_TRUE(solved(mission)["anchors"][0]["local_m"].is_null());
}

// By hand, as in frame_fit_test.cpp: four corners at 25 m from their middle, 0.2 m each, leave a place r from
// it uncertain by 0.2 m sqrt(1/4 + r^2 / 2500) along either horizontal axis, and by 0.1 m upwards.
TEST_F(Calibrations, CountWhatTheFrameIsUncertainAboutPlacesOnTheGlobe) {
  constexpr double sigma_m = 0.2;
  MadeFlight m = made(10);
  m.frame = TrackFrame::local;
  const auto mission = flown(m);
  ASSERT_EQ(post("/api/v1/frames", R"({"name":"hall-b"})").status, 201);
  const EnuFrame frame(m.origin);
  Json pairs = Json::array();
  for (const auto& local : {Eigen::Vector3d(20, 15, 0), Eigen::Vector3d(-20, 15, 0),
                            Eigen::Vector3d(-20, -15, 0), Eigen::Vector3d(20, -15, 0)}) {
    const Wgs84 at = frame.wgs84_from_enu({Eigen::Vector3d(-local.y(), local.x(), 0)});
    pairs.push_back({{"name", "corner"},
                     {"local_m", {local.x(), local.y(), local.z()}},
                     {"lon", at.lon_deg},
                     {"lat", at.lat_deg},
                     {"h_m", at.height_m},
                     {"sigma_m", sigma_m}});
  }
  const auto fit = post("/api/v1/frames/hall-b/fit", Json{{"parameters", 4}, {"pairs", pairs}}.dump());
  ASSERT_EQ(fit.status, 200) << fit.body;
  EXPECT_TRUE(solved(mission)["anchors"][0]["accuracy"]["globe"].is_null());
  const auto answer = solved(mission, {{"frame", "hall-b"}});
  for (std::size_t i = 0; i < m.anchors.size(); ++i) {
    const auto& accuracy = answer["anchors"][i]["accuracy"];
    const auto &local = accuracy["relative"]["cov_enu_m2"], &globe = accuracy["globe"]["cov_enu_m2"];
    const double plane =
        sigma_m * sigma_m * (0.25 + m.anchors[i].head<2>().squaredNorm() / 2500.0);  // 4 mm2 for the error
    EXPECT_NEAR(globe[0].get<double>(), local[3].get<double>() + plane, 1e-3) << "east is -y of the frame";
    EXPECT_NEAR(globe[3].get<double>(), local[0].get<double>() + plane, 1e-3);
    EXPECT_NEAR(globe[1].get<double>(), -local[1].get<double>(), 1e-3);
    EXPECT_NEAR(globe[5].get<double>(), local[5].get<double>() + 0.01, 1e-5);
    EXPECT_GT(accuracy["globe"]["h95_m"].get<double>(), 2.44 * std::sqrt(plane));
    EXPECT_LT(accuracy["relative"]["h95_m"].get<double>(), 0.25) << "the frame's share stays out of it";
  }
  // What is published tells the same, and the map's table gives the figure of what it maps.
  const auto published =
      post("/api/v1/calibrations/" + answer.value("id", "") + "/publish", R"({"note":"local"})");
  ASSERT_EQ(published.status, 201) << published.body;
  const auto feature = json(get("/api/v1/anchors"))["features"][0]["properties"];
  EXPECT_EQ(feature["accuracy"]["globe"], answer["anchors"][0]["accuracy"]["globe"]);
  const auto flat =
      json(get("/api/v1/exports/anchors.geojson", {{"flat", "true"}}))["features"][0]["properties"];
  EXPECT_EQ(flat["h95_m"], answer["anchors"][0]["accuracy"]["globe"]["h95_m"]);
}

TEST_F(Calibrations, SayWhatTheUncertaintyOfEachAnchorComesFrom) {
  const auto id = site(square(40));
  const auto plain = solved(flown(made(11), 0, id))["anchors"];
  for (const auto& anchor : plain) {
    const auto& budget = anchor["budget"];
    const auto& c = anchor["accuracy"]["relative"]["cov_enu_m2"];
    EXPECT_NEAR(budget["trace_m2"].get<double>(),
                c[0].get<double>() + c[3].get<double>() + c[5].get<double>(), 1e-5);
    double share = 0;
    for (const auto& [source, one] : budget["sources"].items()) {
      EXPECT_EQ(source == "base", one.is_null()) << source;  // nobody stated it
      if (!one.is_null()) share += one["share"].get<double>();
    }
    EXPECT_NEAR(share, 1, 1e-4);
    EXPECT_NE(budget["largest"], "base");
    EXPECT_FALSE(budget["help_text"].get<std::string>().empty());
  }
  // A base that is known to a metre only is the largest of all.
  Call options;
  options.type = "application/merge-patch+json";
  options.headers["if-match"] = header(get("/api/v1/sites/" + id), "ETag");
  ASSERT_EQ(call(Method::patch, "/api/v1/sites/" + id,
                 R"({"crs":{"base":{"source":"survey_in","sigma_m":1}}})", options)
                .status,
            200);
  const auto based = solved(flown(made(12), 0, id));
  for (const auto& anchor : based["anchors"]) {
    EXPECT_EQ(anchor["budget"]["largest"], "base");
    EXPECT_EQ(anchor["budget"]["help"], "survey_base");
    EXPECT_NEAR(anchor["budget"]["sources"]["base"]["variance_m2"].get<double>(), 3, 1e-9);
  }
  EXPECT_FALSE(based["provenance"].contains("budgets")) << "each is with its anchor";
  const auto calibration = "/api/v1/calibrations/" + based.value("id", "");
  EXPECT_NE(get(calibration + "/report").body.find("survey the base station"), std::string::npos);
  ASSERT_EQ(post(calibration + "/publish", R"({"anchors":["0x6000"],"reason":"seen"})").status, 201);
  EXPECT_EQ(json(get("/api/v1/anchors/0x6000"))["properties"]["budget"], based["anchors"][0]["budget"]);
}

/// A tag that hangs anywhere within 3 m of where it is declared, and a base that is known to 9 m.
TEST_F(Calibrations, NameTheLargestPartOfARegionThatIsTooWide) {
  const auto id = site(square(40));
  auto one_heading = made(21);
  one_heading.turn_rate_radps = 0;  // else the flight itself would show where it hangs
  const auto mission = flown(one_heading, 0, id);
  auto declared = database_->stores().missions.mission(MissionId{parse_uuid(mission).value()}).value();
  declared.lever_arm_sigma_m = 3;
  ASSERT_TRUE(database_->stores().missions.update(declared));
  const auto expect_named = [&](const std::string& part, const std::string& help) {
    const auto calibration = solved(mission);
    for (const auto& anchor : calibration["anchors"]) {
      const auto reason = anchor["quality"].value("reason", "");
      EXPECT_NE(reason.find("; the largest part of its uncertainty is " + part), std::string::npos) << reason;
      EXPECT_NE(reason.find("help most: " + help), std::string::npos) << reason;
      EXPECT_EQ(anchor["quality"]["acceptable"], false);
    }
    const auto page = get("/api/v1/calibrations/" + calibration.value("id", "") + "/report").body;
    EXPECT_NE(page.find("; the largest part of its uncertainty is " + part), std::string::npos);
  };
  expect_named("the lever arm (", "measure the lever arm");
  Call options;
  options.type = "application/merge-patch+json";
  options.headers["if-match"] = header(get("/api/v1/sites/" + id), "ETag");
  ASSERT_EQ(call(Method::patch, "/api/v1/sites/" + id,
                 R"({"crs":{"base":{"source":"survey_in","sigma_m":9}}})", options)
                .status,
            200);
  expect_named("the base station (", "survey the base station");
}

TEST_F(Calibrations, ShowTheMisclosureOfCheckPointsAndUseNone) {
  const MadeFlight m = made(13);
  const auto mission = flown(m);
  const EnuFrame truth(m.origin);
  const auto surveyed = [&](std::size_t i, const Eigen::Vector3d& off_m) {
    const Wgs84 at = truth.wgs84_from_enu({m.anchors[i] + off_m});
    return Json{{"network_id", to_string(NetworkId{static_cast<std::uint32_t>(0x6000 + i)})},
                {"lon", at.lon_deg},
                {"lat", at.lat_deg},
                {"h_m", at.height_m}};
  };
  const Eigen::Vector3d none(0, 0, 0), moved(3, 0, 0);
  const Json points{surveyed(0, none), surveyed(1, none), surveyed(2, moved)};
  const auto plain = solved(mission), checked = solved(mission, {{"check_points", points}});
  for (std::size_t i = 0; i < 4; ++i)
    EXPECT_EQ(plain["anchors"][i]["enu_m"], checked["anchors"][i]["enu_m"]) << "a check point is no datum";
  EXPECT_TRUE(plain["provenance"]["check_points"].is_null());
  const auto& told = checked["provenance"]["check_points"];
  ASSERT_EQ(told["points"].size(), 3u);
  EXPECT_TRUE(told["points"][0]["agrees"]);
  EXPECT_GT(told["points"][0]["p_value"], 0.001);
  EXPECT_FALSE(told["points"][2]["agrees"]);
  EXPECT_NEAR(told["points"][2]["delta_enu_m"][0].get<double>(), -3, 0.2);
  EXPECT_LT(told["points"][2]["p_value"], 1e-6);
  const auto page = get("/api/v1/calibrations/" + checked.value("id", "") + "/report").body;
  EXPECT_NE(page.find("Check point 0x6002: solved minus surveyed"), std::string::npos);
  EXPECT_NE(page.find("does not agree"), std::string::npos);
  // A base that is off moves all alike.
  const Json off{surveyed(0, moved), surveyed(1, moved), surveyed(3, moved)};
  const auto shifted = solved(mission, {{"check_points", off}})["provenance"]["check_points"]["shift"];
  EXPECT_TRUE(shifted["significant"]) << shifted;
  EXPECT_NEAR(shifted["shift_enu_m"][0].get<double>(), -3, 0.2);
  const auto refused = solve(mission, {{"check_points", {{{"network_id", "0x6000"}, {"lon", 4.7}}}}});
  EXPECT_EQ(refused.status, 422);
  EXPECT_NE(refused.body.find("/check_points/0"), std::string::npos) << refused.body;
}

TEST_F(Calibrations, LeaveRangesBetweenAnchorsOutWhereAsked) {
  MadeFlight m = made(7);
  m.pairs = true;
  const auto mission = flown(m);
  const auto notes = [&](const Json& more) {
    return solved(mission, more)["provenance"]["flights"][0]["notes"].dump();
  };
  EXPECT_NE(notes(Json::object()).find("6 distances between anchors"), std::string::npos);
  EXPECT_NE(notes({{"use_anchor_anchor", true}}).find("6 distances between anchors"), std::string::npos);
  EXPECT_EQ(notes({{"use_anchor_anchor", false}}).find("distances between anchors"), std::string::npos);
}

TEST_F(Calibrations, TakeTheOutlineOfTheSiteAsAPriorUnlessToldNotTo) {
  // Before one wall, up and down: the mirror solution of every anchor is as far in front of the wall as the
  // anchor is behind.
  MadeFlight facade = made(8);
  facade.width_m = 0;
  facade.anchors = {{12, 8, 1.5}, {-10, 9, 6}, {3, 12, 2}, {-6, 10, 9}};
  Json outline = square(30);
  const EnuFrame frame(facade.origin);
  for (auto& corner : outline["coordinates"][0]) {  // its southern wall at n = 4 m
    if (corner[1].get<double>() < facade.origin.lat_deg)
      corner[1] = frame.wgs84_from_enu({Eigen::Vector3d(0, 4, 0)}).lat_deg;
  }
  const auto mission = flown(facade, 0, site(outline));
  const auto without = solved(mission, {{"site_outline", false}});
  EXPECT_EQ(without["provenance"]["priors"]["outline"]["source"], "none");
  const auto with = solved(mission);
  const auto& told = with["provenance"]["priors"]["outline"];
  EXPECT_EQ(with["provenance"]["clues"]["outline"], told) << "under its name up to 0.1 as well";
  EXPECT_EQ(with["provenance"]["n_clues"], with["provenance"]["n_priors"]);
  EXPECT_EQ(told["source"], "site");
  EXPECT_EQ(told["sigma_m"], 1.0);
  for (std::size_t i = 0; i < facade.anchors.size(); ++i) {
    EXPECT_EQ(without["anchors"][i]["verdict"], "ambiguous") << i;
    EXPECT_EQ(with["anchors"][i]["verdict"], "ok") << with["anchors"][i]["reason"];
  }
  EXPECT_LT(error_m(with, facade), 0.3);
}

TEST_F(Calibrations, HoldBackAnAnchorFarOutsideOfTheOutline) {
  const MadeFlight m = made(9);
  const auto answer = solved(flown(m, 0, site(square(5))));  // anchors stand up to 14 m from its middle
  ASSERT_FALSE(answer["anchors"][0]["geometry"].is_null()) << answer["anchors"][0];
  std::string failed;
  for (const auto& gate : answer["anchors"][0]["quality"]["gates"])
    if (!gate["passed"].get<bool>()) failed += gate["name"].get<std::string>() + " ";
  EXPECT_EQ(failed, "outline ");
  EXPECT_LT(error_m(answer, m), 0.3) << "a prior of a metre moves no good answer";
}

}  // namespace
}  // namespace anchord::test::calibration_test
