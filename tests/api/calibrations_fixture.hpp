#pragma once

#include <random>
#include <string>
#include <vector>

#include "app_fixture.hpp"
#include "core/geo/enu.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/ports/mission_store.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test {

using anchord::testing::MadeFlight;
using api::Method;

/// Levels a radio gives behind a wall (6 dB more of the first path lost) and in the open.
struct Levels {
  double rx_dbm, fp_dbm;
};
inline Levels levels(bool blocked, double distance_m, std::mt19937_64& random) {
  std::normal_distribution<double> noise(0, 1);
  const double rx_dbm = -75 - 0.3 * distance_m + noise(random);
  return {rx_dbm, rx_dbm - (blocked ? 9.0 : 2.0) + 1.2 * noise(random)};
}

/// What a wall adds: 0.1 m, and an exponential delay of 0.3 m.
inline double late_m(std::mt19937_64& random) {
  return 0.1 + std::exponential_distribution<double>(1 / 0.3)(random);
}

/// A campaign of the same radio: 5 cm noise, late behind walls.
inline std::string campaign_csv() {
  std::mt19937_64 random(11);
  std::normal_distribution<double> noise(0, 1);
  std::string csv = "environment,setting,true_distance_m,los,range_m,rx_dbm,fp_dbm\n";
  for (int room = 0; room < 6; ++room) {
    for (int k = 0; k < 40; ++k) {
      const bool los = k % 2 == 0;
      const double distance_m = 2.0 + 0.8 * k + 0.1 * room;
      const Levels level = levels(!los, distance_m, random);
      const double wall_m = los ? 0.0 : late_m(random);
      csv += "room " + std::to_string(room) + ",s" + std::to_string(room * 40 + k) + "," +
             std::to_string(distance_m) + "," + (los ? "1" : "0") + "," +
             std::to_string(distance_m + wall_m + 0.05 * noise(random)) + "," + std::to_string(level.rx_dbm) +
             "," + std::to_string(level.fp_dbm) + "\n";
    }
  }
  return csv;
}

class Calibrations : public AppFixture {
 protected:
  static MadeFlight made(std::uint64_t seed) {
    MadeFlight m;
    m.turn_rate_radps = 0.2;  // else a wrong lever arm would not show
    m.seed = seed;
    m.frame = TrackFrame::wgs84;
    return m;
  }
  /// The flight in the store; its mission.
  std::string flown(const MadeFlight& m, double blocked_share = 0, const std::string& site = "",
                    const std::string& kit = "") {
    FlightData data = anchord::testing::make_flight(m);
    std::mt19937_64 random(m.seed + 100);
    std::uniform_real_distribution<double> uniform(0, 1);
    Mission mission = data.mission;
    mission.id.uuid = make_uuid_v7(clock_.now());
    mission.created = clock_.now();
    if (!kit.empty()) mission.kit = kit;
    if (!site.empty()) mission.site = SiteId{parse_uuid(site).value()};
    EXPECT_TRUE(database_->stores().missions.insert(mission).has_value());
    for (auto& fix : data.fixes) fix.mission = mission.id;
    for (auto& range : data.ranges) {
      range.mission = mission.id;
      if (range.kind == RangeKind::anchor_anchor) continue;
      // Some anchors stand behind more walls than others.
      const bool blocked = uniform(random) < blocked_share * (range.anchor.value % 2 == 0 ? 1.7 : 0.3);
      const Levels level = levels(blocked, range.distance_m, random);
      if (blocked) range.distance_m += late_m(random);
      range.rx_dbm = level.rx_dbm;
      range.fp_dbm = level.fp_dbm;
    }
    EXPECT_TRUE(database_->stores().measurements.append_fixes(data.fixes, true).has_value());
    EXPECT_TRUE(database_->stores().measurements.append_ranges(data.ranges, true).has_value());
    return to_string(mission.id);
  }
  api::Response solve(const std::vector<std::string>& missions, Json more = Json::object()) {
    more["missions"] = missions;
    Call options;
    options.headers["prefer"] = "wait=120";
    return call(Method::post, "/api/v1/calibrations", more.dump(), options);
  }
  Json solved(const std::vector<std::string>& missions, const Json& more = Json::object()) {
    const auto response = solve(missions, more);
    EXPECT_EQ(response.status, 201) << response.body;
    return json(response);
  }
  Json solved(const std::string& mission, const Json& more = Json::object()) {
    return solved(std::vector{mission}, more);
  }
  api::Response solve(const std::string& mission, const Json& more = Json::object()) {
    return solve(std::vector{mission}, more);
  }
  /// Mean distance of the anchors from where they are.
  static double error_m(const Json& calibration, const MadeFlight& m) {
    const EnuFrame frame(m.origin);
    double sum_m = 0;
    for (std::size_t i = 0; i < m.anchors.size(); ++i) {
      const auto& at = calibration["anchors"][i]["geometry"]["coordinates"];
      sum_m += (frame.enu_from_wgs84({at[1].get<double>(), at[0].get<double>(), at[2].get<double>()}).m -
                m.anchors[i])
                   .norm();
    }
    return sum_m / static_cast<double>(m.anchors.size());
  }
  void promote_mixture() {
    ASSERT_EQ(post("/api/v1/campaigns", R"({"name":"hall"})").status, 201);
    ASSERT_EQ(post("/api/v1/campaigns/hall/samples", campaign_csv(), "text/csv").status, 200);
    ASSERT_EQ(post("/api/v1/datasets", R"({"name":"set","campaigns":["hall"],"aggregation":"none",
      "split":{"by":"environment","test":["room 5"]}})")
                  .status,
              201);
    Call options;
    options.headers["prefer"] = "wait=120";
    const auto run =
        call(Method::post, "/api/v1/training-runs",
             R"({"task":"bias","dataset":"set","cv":{"folds":4,"seed":3},"importance":false})", options);
    ASSERT_EQ(run.status, 201) << run.body;
    const auto done = post(json(run).value("model", "") + "/promote", R"({"reason":"the same radio"})");
    ASSERT_EQ(done.status, 200) << done.body;
  }
  std::string site(const Json& outline) {
    const auto made = post(
        "/api/v1/sites",
        Json{{"name", "hall"}, {"origin", {{"lon", 4.7}, {"lat", 50.88}, {"h_m", 80}}}, {"outline", outline}}
            .dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made).value("id", "");
  }
  /// A square of 2 x half_m about the place the flights are made at.
  static Json square(double half_m) {
    const EnuFrame frame(MadeFlight{}.origin);
    Json ring = Json::array();
    for (const auto& [e, n] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}, {-1, -1}}) {
      const Wgs84 at = frame.wgs84_from_enu({Eigen::Vector3d(half_m * e, half_m * n, 0)});
      ring.push_back({at.lon_deg, at.lat_deg});
    }
    return {{"type", "Polygon"}, {"coordinates", {ring}}};
  }
};

}  // namespace anchord::test
