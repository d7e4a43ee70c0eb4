#pragma once

#include <algorithm>
#include <map>
#include <string>

#include "app_fixture.hpp"
#include "tests/core/localize/flight_support.hpp"

namespace anchord::test {

using testing::MadeFlight;
using testing::make_flight;

inline constexpr std::int64_t k_start_us = 1'777'889'472'000'000;

/// Rows in the order a stream brings them.
inline FlightData streamed(const MadeFlight& made) {
  auto flight = make_flight(made);
  std::ranges::stable_sort(flight.ranges, {}, &Range::time);
  return flight;
}

/// Made flights delivered as rows, and their running estimates.
class MissionLive : public AppFixture {
 protected:
  /// Rows of the made flight between two of its seconds, as NDJSON.
  template <class Rows, class Write>
  static std::string ndjson(const Rows& rows, double from_s, double to_s, Write write) {
    std::string out;
    std::int64_t seq = 0;
    for (const auto& row : rows) {
      const double t_s = row.time.seconds();
      ++seq;
      if (t_s < from_s || t_s >= to_s) continue;
      Json json = write(row);
      json["t_us"] = k_start_us + row.time.us();
      json["seq"] = seq;
      out += json.dump() + '\n';
    }
    return out;
  }
  void deliver(const std::string& mission, const FlightData& flight, double from_s, double to_s) {
    const auto fixes = ndjson(flight.fixes, from_s, to_s, [](const Fix& fix) {
      const Wgs84& at = fix.position;
      if (fix.frame == TrackFrame::wgs84)
        return Json{{"lon", at.lon_deg}, {"lat", at.lat_deg}, {"h_m", at.height_m}, {"fix", "fixed"}};
      return Json{{"local_m", {fix.local_m.x(), fix.local_m.y(), fix.local_m.z()}}, {"fix", "fixed"}};
    });
    const auto ranges = ndjson(flight.ranges, from_s, to_s, [](const Range& range) {
      return Json{{"tag", to_string(range.tag)},
                  {"anchor", to_string(range.anchor)},
                  {"distance_m", range.distance_m}};
    });
    for (const auto& [path, body] : {std::pair{"/api/v1/fixes", fixes}, {"/api/v1/ranges", ranges}}) {
      if (body.empty()) continue;
      const auto answer = post(path, body, "application/x-ndjson", {{"mission", mission}});
      ASSERT_EQ(answer.status, 200) << answer.body;
      ASSERT_EQ(json(answer)["rejected"], 0) << answer.body;
    }
  }
  std::map<std::string, Json> live(const std::string& mission) {
    std::map<std::string, Json> out;
    const auto answer = get("/api/v1/anchors", {{"view", "live"}, {"mission", mission}});
    EXPECT_EQ(answer.status, 200) << answer.body;
    const Json body = json(answer);
    for (const auto& feature : body["features"])
      out[feature["properties"]["network_id"].get<std::string>()] = feature["properties"];
    return out;
  }
};

}  // namespace anchord::test
