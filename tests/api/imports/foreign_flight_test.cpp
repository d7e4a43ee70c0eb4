// Tables of other programs: the cases of tests/data/import, which the dashboard's reader runs too.
#include "api/formats/foreign_flight.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "api/wire/row_limits.hpp"
#include "core/base/base64.hpp"
#include "tests/paths.hpp"

namespace anchord::api::foreign_flight_test {
namespace {

using Json = nlohmann::json;

Json file(const std::string& name) {
  std::ifstream in(std::string(ANCHORD_TEST_DATA "/import/") + name);
  return Json::parse(in);
}

ForeignOptions given_of(const Json& one) {
  ForeignOptions out;
  out.tag = "0x6e01";
  if (!one.contains("given")) return out;
  const Json& given = one["given"];
  out.tag = given.value("tag", out.tag);
  if (given.contains("crs")) out.crs = given["crs"];
  if (given.contains("heights")) out.heights = given["heights"];
  if (given.contains("fix_numbers"))
    out.fix_numbers = k_fix_numbers_words.find(given["fix_numbers"].get<std::string>());
  if (given.contains("heading")) out.heading = k_heading_kind_words.find(given["heading"].get<std::string>());
  if (given.contains("addresses"))
    out.addresses = k_address_kind_words.find(given["addresses"].get<std::string>());
  if (given.contains("axes")) out.axes = k_track_axes_words.find(given["axes"].get<std::string>());
  if (given.contains("track_time_scale"))
    out.track_time_scale = k_time_scale_words.find(given["track_time_scale"].get<std::string>());
  if (given.contains("epoch_utc"))
    out.epoch_us = parse_rfc3339(given["epoch_utc"].get<std::string>()).value().us();
  for (const auto& [key, columns] :
       {std::pair{"track_columns", &out.track_columns}, std::pair{"range_columns", &out.range_columns}}) {
    const Json named = given.value(key, Json::object());
    for (const auto& [field, column] : named.items()) (*columns)[field] = column.get<std::string>();
  }
  return out;
}

void expect_fix(const Fix& fix, const Json& wanted) {
  EXPECT_EQ(fix.time.us(), wanted["t_us"].get<std::int64_t>());
  EXPECT_EQ(fix.seq, wanted["seq"].get<std::uint64_t>());
  EXPECT_EQ(k_fix_words.word(fix.fix), wanted["fix"].get<std::string>());
  const Eigen::Vector3d place =
      fix.frame == TrackFrame::wgs84
          ? Eigen::Vector3d(fix.position.lon_deg, fix.position.lat_deg, fix.position.height_m)
          : fix.local_m;
  for (int i = 0; i < 3; ++i)
    EXPECT_NEAR(place[i], wanted["place"][static_cast<std::size_t>(i)].get<double>(), 1e-9);
  ASSERT_EQ(fix.covariance_m2.has_value(), wanted.contains("sigma_m"));
  for (int i = 0; fix.covariance_m2 && i < 3; ++i)
    EXPECT_NEAR(std::sqrt((*fix.covariance_m2)(i, i)),
                wanted["sigma_m"][static_cast<std::size_t>(i)].get<double>(), 1e-12);
  ASSERT_EQ(fix.enu_from_body.has_value(), wanted.contains("heading_deg"));
  if (fix.enu_from_body) {
    EXPECT_LT(fix.enu_from_body->angularDistance(row_limits::rotation_of_heading(wanted["heading_deg"])),
              1e-9);
  }
  EXPECT_EQ(fix.correction_age_s.has_value(), wanted.contains("correction_age_s"));
  EXPECT_EQ(fix.satellites.has_value(), wanted.contains("satellites"));
  if (fix.correction_age_s) {
    EXPECT_EQ(*fix.correction_age_s, wanted["correction_age_s"].get<double>());
  }
  if (fix.satellites) {
    EXPECT_EQ(*fix.satellites, wanted["satellites"].get<int>());
  }
}

void expect_range(const Range& range, const Json& wanted) {
  EXPECT_EQ(range.time.us(), wanted["t_us"].get<std::int64_t>());
  EXPECT_EQ(range.seq, wanted["seq"].get<std::uint64_t>());
  EXPECT_EQ(range.tag.value, wanted["tag"].get<std::uint32_t>());
  EXPECT_EQ(range.anchor.value, wanted["anchor"].get<std::uint32_t>());
  EXPECT_NEAR(range.distance_m, wanted["distance_m"].get<double>(), 1e-9);
  ASSERT_EQ(range.rss_dbm.has_value(), wanted.contains("rss_dbm"));
  if (range.rss_dbm) {
    EXPECT_EQ(*range.rss_dbm, wanted["rss_dbm"].get<double>());
  }
}

void expect_source(const std::optional<SourceCrsSpec>& source, const Json& one) {
  ASSERT_EQ(source.has_value(), one.contains("source"));
  if (!source) return;
  SourceCrsSpec wanted;
  ASSERT_TRUE(read_heights(one["source"]["heights"].get<std::string>(), wanted));
  EXPECT_EQ(source->crs, one["source"]["crs"].get<std::string>());
  EXPECT_EQ(source->height_epsg, wanted.height_epsg);
  EXPECT_EQ(source->separation_m, wanted.separation_m);
}

/// The whole of a case; the message of what went wrong is returned.
std::string run(const Json& one) {
  const std::string bytes = one.contains("track_base64")
                                ? from_base64(one["track_base64"].get<std::string>()).value()
                                : one["track"].get<std::string>();
  const auto track = ForeignTable::parse("track", bytes);
  if (!track) return track.error().message;
  auto ranges = ForeignTable::parse("ranges", one["ranges"].get<std::string>());
  if (!ranges) return ranges.error().message;
  ForeignTable table = std::move(ranges).value();
  if (one.value("column_for_each_anchor", false)) {
    std::vector<std::string> claimed;
    for (const auto& [field, column] : guessed_range_columns(table)) claimed.push_back(column);
    table = std::move(table).with_a_row_for_each_range(table.number_columns(claimed));
  }
  const auto options = given_of(one);
  EXPECT_EQ(Json(foreign_needs(track.value(), table, options)), one.value("needs", Json::array()));
  const auto read = foreign_flight(track.value(), table, options);
  if (!read) return one.contains("needs") ? "" : read.error().message;
  EXPECT_FALSE(one.contains("needs")) << "taken without what has to be given";
  const auto& flight = read.value();
  EXPECT_EQ(flight.data.fixes.size(), one["fixes"].size());
  for (std::size_t i = 0; i < std::min(flight.data.fixes.size(), one["fixes"].size()); ++i)
    expect_fix(flight.data.fixes[i], one["fixes"][i]);
  EXPECT_EQ(flight.data.ranges.size(), one["ranges_read"].size());
  for (std::size_t i = 0; i < std::min(flight.data.ranges.size(), one["ranges_read"].size()); ++i)
    expect_range(flight.data.ranges[i], one["ranges_read"][i]);
  EXPECT_EQ(Json(flight.refused), one.value("refused", Json::array()));
  EXPECT_EQ(Json(flight.unknown_fix), one.value("unknown_fix", Json::object()));
  expect_source(flight.source, one);
  return "";
}

TEST(ForeignFlight, ReadsEveryCaseAsTheDashboardDoes) {
  for (const auto& one : file("cases.json")) {
    SCOPED_TRACE(one["name"].get<std::string>());
    const auto why = run(one);
    if (one.contains("error"))
      EXPECT_NE(why.find(one["error"].get<std::string>()), std::string::npos) << why;
    else
      EXPECT_EQ(why, "");
  }
}

TEST(ForeignFlight, KnowsTheColumnsThatTheDashboardKnows) {
  Json own = Json::object();
  for (const auto& known : k_foreign_fields) {
    Json& names = own[std::string(known.field)] = Json::array();
    for (std::string_view rest = known.names; !rest.empty();) {
      const auto end = rest.find(' ');
      names.push_back(std::string(rest.substr(0, end)));
      rest.remove_prefix(end == std::string_view::npos ? rest.size() : end + 1);
    }
  }
  EXPECT_EQ(own, file("columns.json"));
}

TEST(ForeignFlight, PutsATrackOfAMapOnTheGlobeAndSaysSo) {
  auto track = ForeignTable::parse(
      "track", "time_s,E,N,alt_msl,fix\n1777888801.5,691650.366852,5334754.246451,520,fixed\n");
  auto ranges = ForeignTable::parse("ranges", "time_s,anchor,range_m\n1777888801.5,0x6a21,7.4\n");
  ASSERT_TRUE(track && ranges);
  ForeignOptions options;
  options.tag = "0x6e01";
  options.crs = "EPSG:25832";
  options.heights = "45.25";
  options.lever_arm_body_m = {0.1, 0, -0.2};
  const auto flight = read_foreign_flight(std::move(track).value(), std::move(ranges).value(), options);
  ASSERT_TRUE(flight) << flight.error().message;
  // gdaltransform -s_srs EPSG:4979 -t_srs EPSG:25832 of 11.576124 48.137154.
  const auto& fix = flight.value().fixes.at(0);
  EXPECT_NEAR(fix.position.lon_deg, 11.576124, 1e-8);
  EXPECT_NEAR(fix.position.lat_deg, 48.137154, 1e-8);
  EXPECT_NEAR(fix.position.height_m, 565.25, 1e-6);
  EXPECT_EQ(flight.value().mission.frame, TrackFrame::wgs84);
  EXPECT_EQ(flight.value().mission.tags.at(0).lever_arm_body_m.z(), -0.2);
  EXPECT_NE(Json(flight.value().notes).dump().find("ETRS89 / UTM zone 32N to ETRS89"), std::string::npos);
}

TEST(ForeignFlight, NamesTheOptionThatSaysWhatIsNotKnown) {
  auto track = ForeignTable::parse("t.csv", "time,lat,lon,alt,fix,yaw\n1777888801.5,51,3.7,55,1,1.5\n");
  auto ranges = ForeignTable::parse("r.csv", "time,who,range_m,tag_id\n1777888801.5,0x6a21,7.4,6e0c\n");
  const auto flight = read_foreign_flight(std::move(track).value(), std::move(ranges).value(), {});
  ASSERT_FALSE(flight);
  for (const char* option :
       {"--column ranges.anchor=NAME", "--addresses", "--heading", "--fix-numbers", "--heights"})
    EXPECT_NE(flight.error().message.find(option), std::string::npos) << flight.error().message;
}

TEST(ForeignFlight, NamesTheColumnsThatNothingUses) {
  auto track = ForeignTable::parse(
      "t.csv", "time,lat,N/S,lon,E/W,h_ell,alt_units,speed,fix\n1777888801.5,51,N,3.7,W,55,m,2,FIX\n");
  auto ranges = ForeignTable::parse("r.csv", "time,anchor,range_m,battery,\n1777888801.5,0x6a21,7.4,3.9,\n");
  ForeignOptions options;
  options.tag = "0x6e01";
  const auto flight = read_foreign_flight(std::move(track).value(), std::move(ranges).value(), options);
  ASSERT_TRUE(flight) << flight.error().message;
  const auto notes = Json(flight.value().notes).dump();
  EXPECT_NE(notes.find("t.csv: columns that are not used: speed\""), std::string::npos) << notes;
  EXPECT_NE(notes.find("r.csv: columns that are not used: battery\""), std::string::npos) << notes;
  EXPECT_NE(notes.find("taken as a position without RTK"), std::string::npos) << notes;
  EXPECT_EQ(flight.value().fixes.at(0).position.lon_deg, -3.7);
}

/// A row each `spacing`, of a place that stays above zero.
ForeignTable table_every(const std::string& name, const std::string& head, const std::string& cells, int n,
                         int spacing) {
  std::string text = head + '\n';
  for (int i = 0; i < n; ++i) text += std::to_string(100'000'000 + i * spacing) + ',' + cells + '\n';
  return ForeignTable::parse(name, text).value();
}

TEST(ForeignFlight, AsksForAUnitOfTimesWhereTwoFitAndNamesTheOption) {
  // 5000 apart: one row in 5 s by milliseconds, 200 Hz by microseconds.
  const auto track = table_every("t.csv", "t,x,y,z", "1,2,3", 1200, 5000),
             ranges = table_every("r.csv", "t,anchor,range_m", "0x6a21,7.4", 1200, 5000);
  ForeignOptions options;
  options.tag = "0x6e01";
  EXPECT_EQ(foreign_needs(track, ranges, options),
            (Needs{"unit of the track times", "unit of the range times"}));
  const auto asked = foreign_flight(track, ranges, options);
  ASSERT_FALSE(asked);
  EXPECT_NE(asked.error().message.find("--track-time ms or us"), std::string::npos) << asked.error().message;
  EXPECT_NE(asked.error().message.find("--range-time ms or us"), std::string::npos) << asked.error().message;
  options.track_time_unit = options.range_time_unit = TimeUnit::us;
  const auto said = foreign_flight(track, ranges, options);
  ASSERT_TRUE(said) << said.error().message;
  EXPECT_EQ(said.value().data.fixes.at(1).time.us() - said.value().data.fixes.at(0).time.us(), 5000);
}

TEST(ForeignFlight, ReadsOneColumnOfOneFileInOneUnit) {
  const auto table = table_every("log.csv", "Timestamp,x,y,z,anchor,range_m", "1,2,3,0x6a21,7.4", 1200, 5000);
  ForeignOptions options;
  options.tag = "0x6e01";
  options.range_time_unit = TimeUnit::ms;
  const auto read = foreign_flight(table, table, options);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().data.fixes.back().time, read.value().data.ranges.back().time);
  options.track_time_unit = TimeUnit::us;
  const auto torn = foreign_flight(table, table, options);
  ASSERT_FALSE(torn);
  EXPECT_NE(torn.error().message.find("--track-time and --range-time the same"), std::string::npos)
      << torn.error().message;
}

TEST(ForeignFlight, SaysThatItTurnedATrackThatCountsDownwards) {
  const auto track = ForeignTable::parse("t.csv", "time,north,east,down\n1777888801.5,3,4,-5\n");
  const auto ranges =
      ForeignTable::parse("r.csv", "time,tag,anchor,range_m\n1777888801.5,0x6e01,0x6a21,7.4\n");
  const auto flight = foreign_flight(track.value(), ranges.value(), {});
  ASSERT_TRUE(flight) << flight.error().message;
  const auto notes = Json(flight.value().data.notes).dump();
  EXPECT_NE(notes.find("'down' counts downwards"), std::string::npos) << notes;
  EXPECT_NE(notes.find("--track-axes enu"), std::string::npos) << notes;
}

TEST(ForeignFlight, TurnsAttitudesOfATrackThatCountsDownwards) {
  // Nose to the east and 10 degrees up: in NED a yaw of 90 and a pitch of 10 degrees.
  const double half_yaw = 45 * 3.14159265358979 / 180, half_pitch = 5 * 3.14159265358979 / 180;
  const double w = std::cos(half_yaw) * std::cos(half_pitch), x = -std::sin(half_yaw) * std::sin(half_pitch),
               y = std::cos(half_yaw) * std::sin(half_pitch), z = std::sin(half_yaw) * std::cos(half_pitch);
  std::string row = "1777888801.5,3,4,-5";
  for (const double part : {x, y, z, w}) row += ',' + std::to_string(part);
  const auto track = ForeignTable::parse("t.csv", "time,north,east,down,qx,qy,qz,qw\n" + row + "\n");
  const auto ranges =
      ForeignTable::parse("r.csv", "time,tag,anchor,range_m\n1777888801.5,0x6e01,0x6a21,7.4\n");
  const auto flight = foreign_flight(track.value(), ranges.value(), {});
  ASSERT_TRUE(flight) << flight.error().message;
  const auto& attitude = flight.value().data.fixes.at(0).enu_from_body;
  ASSERT_TRUE(attitude);
  const Eigen::Vector3d nose = *attitude * Eigen::Vector3d::UnitX(),
                        left = *attitude * Eigen::Vector3d::UnitY();
  EXPECT_LT((nose - Eigen::Vector3d(std::cos(2 * half_pitch), 0, std::sin(2 * half_pitch))).norm(), 1e-5);
  EXPECT_LT((left - Eigen::Vector3d(0, 1, 0)).norm(), 1e-5);
}

struct TwoTags {
  Result<ForeignTable> track = ForeignTable::parse("t.csv", "time,x,y,z\n1777888801.5,1,2,3\n");
  Result<ForeignTable> ranges = ForeignTable::parse("r.csv",
                                                    "time,tag,anchor,range_m\n1777888801.5,10,3,7.4\n"
                                                    "1777888801.6,11,3,7.5\n1777888801.7,2,10,7.6\n");
};

TEST(ForeignFlight, SaysThatSeveralTagsHaveOneLeverArmAndThatAnAddressIsTagAndAnchor) {
  const TwoTags tables;
  ForeignOptions options;
  options.lever_arm_body_m = {0.1, 0, -0.2};
  const auto flight = foreign_flight(tables.track.value(), tables.ranges.value(), options);
  ASSERT_TRUE(flight) << flight.error().message;
  const auto notes = Json(flight.value().data.notes).dump();
  EXPECT_NE(notes.find("3 tags"), std::string::npos) << notes;
  EXPECT_NE(notes.find("--lever-arm TAG=FORWARD,LEFT,UP for each"), std::string::npos) << notes;
  EXPECT_NE(notes.find(to_string(NetworkId{10}) + " is tag of some ranges and anchor of others"),
            std::string::npos)
      << notes;
}

TEST(ForeignFlight, TakesALeverArmForEachTagAndTurnsRangesThatAnAnchorBegan) {
  const TwoTags tables;
  ForeignOptions options;
  options.lever_arms_body_m = {{"10", {0.1, 0, -0.2}}, {"0x0b", {-0.1, 0, -0.2}}};
  const auto read = foreign_flight(tables.track.value(), tables.ranges.value(), options);
  ASSERT_TRUE(read) << read.error().message;
  const auto& data = read.value().data;
  ASSERT_EQ(data.mission.tags.size(), 2U);
  for (const auto& tag : data.mission.tags)
    EXPECT_EQ(tag.lever_arm_body_m.x(), tag.tag == NetworkId{10} ? 0.1 : -0.1) << to_string(tag.tag);
  EXPECT_EQ(data.ranges.at(2).tag, NetworkId{10});
  EXPECT_EQ(data.ranges.at(2).anchor, NetworkId{2});
  const auto notes = Json(data.notes).dump();
  EXPECT_NE(notes.find("1 ranges were begun by the anchor"), std::string::npos) << notes;
  EXPECT_EQ(notes.find("warning"), std::string::npos) << notes;
}

TEST(ForeignFlight, RefusesALeverArmOfNoTagAndATagWithoutOne) {
  const TwoTags tables;
  for (const auto& [arm_of, says] :
       {std::pair{"77", "no range is of that tag"}, std::pair{"10", "has no lever arm"}}) {
    ForeignOptions options;
    options.lever_arms_body_m = {{arm_of, {0.1, 0, -0.2}}};
    const auto flight = foreign_flight(tables.track.value(), tables.ranges.value(), options);
    ASSERT_FALSE(flight);
    EXPECT_NE(flight.error().message.find(says), std::string::npos) << flight.error().message;
    EXPECT_NE(flight.error().message.find("--lever-arm"), std::string::npos) << flight.error().message;
  }
}

TEST(ForeignFlight, NamesColumnOptionsWhereAPlaceHasNoColumn) {
  const auto track = ForeignTable::parse("t.csv", "time,a,b,c\n1777888801.5,1,2,3\n");
  const auto ranges =
      ForeignTable::parse("r.csv", "time,tag,anchor,range_m\n1777888801.5,0x6e01,0x6a21,7.4\n");
  const auto flight = foreign_flight(track.value(), ranges.value(), {});
  ASSERT_FALSE(flight);
  for (const char* option : {"--column track.lat=NAME", "track.x=NAME"})
    EXPECT_NE(flight.error().message.find(option), std::string::npos) << flight.error().message;
}

}  // namespace
}  // namespace anchord::api::foreign_flight_test
