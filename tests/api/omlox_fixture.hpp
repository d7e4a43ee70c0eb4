#pragma once

#include "app_fixture.hpp"
#include "core/geo/enu.hpp"

namespace anchord::test {

/// A hall with published anchors on its ground floor, and a flight with a tag.
class OmloxFixture : public AppFixture {
 protected:
  static constexpr double k_lat = 51.023, k_lon = 3.713, k_height_m = 55;

  /// Published anchors at these places (east, north, up of the site's origin), from 0x6a21 on; the site.
  std::string hall(const std::vector<Eigen::Vector3d>& enu_m, const std::string& floor = "0") {
    const auto made =
        post("/api/v1/sites",
             Json{{"name", "ghent-west"}, {"origin", {{"lon", k_lon}, {"lat", k_lat}, {"h_m", k_height_m}}}}
                 .dump());
    EXPECT_EQ(made.status, 201) << made.body;
    const std::string site = json(made)["id"];
    publish(enu_m);
    for (std::size_t i = 0; i < enu_m.size(); ++i)
      patch(name(i), {{"site", site}, {"building", "B1"}, {"floor", floor}});
    return site;
  }
  static std::string name(std::size_t i) {
    return to_string(NetworkId{0x6a21u + static_cast<std::uint32_t>(i)});
  }
  void publish(const std::vector<Eigen::Vector3d>& enu_m) {
    Calibration c;
    c.id.uuid = make_uuid_v7(clock_.now());
    c.missions = {MissionId{parse_uuid(mission()).value()}};
    c.origin = Wgs84{k_lat, k_lon, k_height_m};
    c.settings = {"{}"};
    c.created = clock_.now();
    const EnuFrame at(*c.origin);
    for (std::size_t i = 0; i < enu_m.size(); ++i) {
      Estimate e;
      e.anchor = {0x6a21u + static_cast<std::uint32_t>(i)};
      e.time = clock_.now();
      e.verdict = Verdict::ok;
      e.best.emplace();
      e.best->position = {enu_m[i]};
      e.best->wgs84 = at.wgs84_from_enu({enu_m[i]});
      e.best->covariance_m2 = Eigen::Vector3d(4e-4, 4e-4, 1e-3).asDiagonal();
      e.h95_m = 0.05;
      e.v95_m = 0.06;
      e.n_used = 100;
      e.gates = {{"redundancy", 96.0, 30.0, true, ""}};
      c.anchors.push_back(std::move(e));
    }
    ASSERT_TRUE(database_->stores().calibrations.insert(c).has_value());
    const auto done = post("/api/v1/calibrations/" + to_string(c.id) + "/publish", "{}");
    ASSERT_EQ(done.status, 201) << done.body;
  }
  void patch(const std::string& anchor, const Json& fields) {
    const auto path = "/api/v1/anchors/" + anchor;
    Call options;
    options.type = "application/merge-patch+json";
    options.headers["if-match"] = header(get(path), "ETag");
    const auto done = call(api::Method::patch, path, fields.dump(), options);
    ASSERT_EQ(done.status, 200) << done.body;
  }
  /// Frame hall-a of the site: local x = east + 1 m, y = north + 2 m, z = up.
  void fit(const std::string& site, const std::vector<Eigen::Vector3d>& enu_m) {
    ASSERT_EQ(post("/api/v1/frames", Json{{"name", "hall-a"}, {"site", site}}.dump()).status, 201);
    Json pairs = Json::array();
    for (std::size_t i = 0; i < enu_m.size(); ++i)
      pairs.push_back({{"anchor", name(i)}, {"local_m", {enu_m[i].x() + 1, enu_m[i].y() + 2, enu_m[i].z()}}});
    const auto fitted = post("/api/v1/frames/hall-a/fit", Json{{"parameters", 4}, {"pairs", pairs}}.dump());
    ASSERT_EQ(fitted.status, 200) << fitted.body;
  }
  /// A flight with tag 0x6e01 of kit-1; its id.
  std::string flight(const std::optional<std::string>& site = {}) {
    Json wanted{{"name", "f"},
                {"kit", "kit-1"},
                {"frame", "wgs84"},
                {"track_point", "gnss_antenna"},
                {"tags", {{{"tag", "0x6e01"}, {"lever_arm_body_m", {0, 0, -0.5}}}}}};
    if (site) wanted["site"] = *site;
    const auto made = post("/api/v1/missions", wanted.dump());
    EXPECT_EQ(made.status, 201) << made.body;
    return json(made)["id"];
  }
  /// A live position of the flight, its tag 0.5 m below the antenna.
  void fly(const std::string& flight, double lon = k_lon) {
    app_->hub().publish(api::Topic::drone_pose,
                        Json{{"mission", flight},
                             {"t_us", 1777889472345678},
                             {"lon", lon},
                             {"lat", k_lat},
                             {"h_m", 61.4},
                             {"enu_m", {0, 0, 6.4}},
                             {"heading_deg", 120.5},
                             {"fix", "fixed"},
                             {"sigma_m", {0.03, 0.04, 0.02}},
                             {"tag_enu_m", {0, 0, 5.9}},
                             {"speed_mps", 1.2}}
                            .dump(),
                        1777889472345678, flight, {}, MissionId{parse_uuid(flight).value()});
  }
  const std::vector<Eigen::Vector3d> square_{{0, 0, 3}, {10, 0, 3}, {0, 8, 3}, {10, 8, 3.5}};
};

}  // namespace anchord::test
