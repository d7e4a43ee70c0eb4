#include "api/formats/flight_folder.hpp"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "api/calibration/kit_profile_json.hpp"

namespace anchord::flight_folder_test {
namespace {

namespace fs = std::filesystem;

constexpr const char* k_globe = R"({"kit": "k", "track": {"frame": "wgs84", "point": "gnss_antenna",
  "heading_column": "yaw", "heading_enu_ccw_from_east_deg": {"add": 30}},
  "tags": [{"tag_id": "tag", "lever_arm_body_m": [0.2, 0, 0]}]})";
constexpr const char* k_local = R"({"kit": "k", "track": {"frame": "local", "point": "body", "in": "ranges",
  "attitude": "quaternion_xyzw"}, "tags": [{"tag_id": "200", "antenna": "1", "lever_arm_body_m": [0, 0, 0]}]})";

class FlightFolder : public ::testing::Test {
 protected:
  fs::path folder_ =
      fs::path(::testing::TempDir()) / ::testing::UnitTest::GetInstance()->current_test_info()->name();
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  void write(const char* name, const std::string& text) {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  void globe() {
    write("flight.json", k_globe);
    write("track.csv",
          "t_s,lat_deg,lon_deg,alt_m,fix,sd_h_m,sd_v_m,yaw\n0.0,50.1,4.2,80,2,0.01,0.02,60\n0.5,50.2,4.3,81,"
          "0,2.4,3,61\n");
    write("ranges.csv", "t_s,anchor_id,range_m,rx_dbm,fp_dbm\n0.1,3,6.14,-79.5,-81\n0.2,0x6a2f,0,-79,-80\n");
  }
  std::string error() {
    const auto flight = read_flight_folder(folder_);
    return flight ? "no error" : flight.error().message;
  }
  void expect_error(const std::string& part) { EXPECT_NE(error().find(part), std::string::npos) << error(); }
};

TEST_F(FlightFolder, ReadsTablesWhoseFirstLineTellsExcelTheSeparator) {
  globe();
  write("track.csv",
        "sep=;\r\nt_s;lat_deg;lon_deg;alt_m;fix;yaw\r\n0.0;50.1;4.2;80;2;60\r\n0.5;50.2;4.3;81;2;61\r\n");
  write("ranges.csv", "sep=,\nt_s,anchor_id,range_m\n0.1,3,6.14\n");
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().fixes.size(), 2U);
  EXPECT_EQ(read.value().ranges.size(), 1U);
  EXPECT_NEAR(read.value().fixes.at(1).position.lat_deg, 50.2, 1e-12);
}

TEST_F(FlightFolder, ReadsATrackOnTheGlobe) {
  globe();
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read) << read.error().message;
  const FlightData& flight = read.value();
  EXPECT_EQ(flight.mission.kit, "k");
  EXPECT_EQ(flight.mission.frame, TrackFrame::wgs84);
  EXPECT_NEAR(flight.mission.tags.at(0).lever_arm_body_m.x(), 0.2, 1e-12);
  ASSERT_EQ(flight.fixes.size(), 2U);
  EXPECT_EQ(flight.fixes[0].fix, FixClass::rtk_fixed);
  EXPECT_EQ(flight.fixes[1].fix, FixClass::single);
  EXPECT_NEAR(flight.fixes[0].covariance_m2->operator()(2, 2), 4e-4, 1e-12);
  // 60 + 30 degrees counter-clockwise from east: forward points north.
  EXPECT_LT((*flight.fixes[0].enu_from_body * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(),
            1e-12);
  ASSERT_EQ(flight.ranges.size(), 2U);
  EXPECT_EQ(flight.ranges[0].time.us(), 100'000);
  EXPECT_EQ(flight.ranges[1].anchor.value, 0x6a2fU);
  EXPECT_EQ(flight.ranges[1].distance_m, 0.0);  // the failure value passes; the solver refuses and counts it
  EXPECT_EQ(flight.anchor_names.at(NetworkId{3}), "3");
  EXPECT_EQ(flight.ranges[0].tag, flight.mission.tags[0].tag);
}

TEST_F(FlightFolder, LeavesPositionsOfAbsurdStandardDeviationsOutAndCountsThem) {
  globe();
  write("track.csv",
        "t_s,lat_deg,lon_deg,alt_m,fix,sd_h_m,sd_v_m,yaw\n0,50,4,80,2,0.01,0.02,60\n1,50,4,80,2,0,0.02,60\n"
        "2,50,4,80,2,-1,0.02,60\n3,50,4,80,2,nan,0.02,60\n4,50,4,80,2,inf,0.02,60\n5,50,4,80,2,0.01,0,60\n"
        "6,50,4,80,2,,,60\n");
  const auto flight = read_flight_folder(folder_);
  ASSERT_TRUE(flight) << flight.error().message;
  ASSERT_EQ(flight.value().fixes.size(), 2U);
  EXPECT_FALSE(flight.value().fixes[1].covariance_m2) << "nothing was said of it";
  std::string notes;
  for (const auto& note : flight.value().notes) notes += note;
  EXPECT_NE(notes.find("track: 5 rows without a finite pose, or with a standard deviation"),
            std::string::npos)
      << notes;
}

TEST_F(FlightFolder, RefusesMapCoordinatesAsALocalFrameOrAsDegrees) {
  write("flight.json", R"({"track": {"frame": "local", "point": "body"}})");
  write("ranges.csv", "t_s,anchor_id,range_m\n0.1,3,6.14\n");
  for (const char* row : {"691650.4,5334754.2,565", "530000,180000,50", "4178000.1,855806.0,4727488.2"}) {
    write("track.csv", std::string("t_s,x_m,y_m,z_m\n0.0,") + row + "\n");
    expect_error("track.csv:2: x_m, y_m, z_m are beyond 100 km of zero");
  }
  write("flight.json", R"({"track": {"frame": "wgs84", "point": "body"}})");
  write("track.csv", "t_s,lon_deg,lat_deg,alt_m\n0.0,691650.4,5334754.2,565\n");
  expect_error("frame crs of flight.json");
}

TEST_F(FlightFolder, PutsATrackOfAMapOnTheGlobe) {
  write("flight.json", R"({"track": {"frame": "crs", "crs": "EPSG:25832", "heights": "45.25", "point": "body",
      "heading_column": "yaw"}})");
  write("ranges.csv", "t_s,anchor_id,range_m\n0.1,3,6.14\n");
  write("track.csv", "t_s,x_m,y_m,z_m,fix,sd_h_m,yaw\n0.0,691650.366852,5334754.246451,520,2,0.01,90\n");
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().mission.frame, TrackFrame::wgs84);
  const Fix& fix = read.value().fixes.at(0);
  // gdaltransform -s_srs EPSG:4979 -t_srs EPSG:25832 of 11.576124 48.137154.
  EXPECT_NEAR(fix.position.lon_deg, 11.576124, 1e-8);
  EXPECT_NEAR(fix.position.lat_deg, 48.137154, 1e-8);
  EXPECT_NEAR(fix.position.height_m, 565.25, 1e-6);
  // Forward to grid north, which is 1.919 degrees east of north (GeographicLib, UTMUPS).
  const Eigen::Vector3d forward = *fix.enu_from_body * Eigen::Vector3d::UnitX();
  EXPECT_NEAR(std::atan2(forward.x(), forward.y()) * 180 / M_PI, 1.919, 1e-3);
  ASSERT_FALSE(read.value().notes.empty());
  EXPECT_NE(read.value().notes.back().find("from ETRS89 / UTM zone 32N to ETRS89"), std::string::npos)
      << read.value().notes.back();
}

TEST_F(FlightFolder, SaysWhatIsWrongWithASystem) {
  write("ranges.csv", "t_s,anchor_id,range_m\n0.1,3,6.14\n");
  write("track.csv", "t_s,x_m,y_m,z_m\n0.0,691650.366852,5334754.246451,520\n");
  write("flight.json", R"({"track": {"frame": "crs", "point": "body"}})");
  expect_error("key 'crs' is missing");
  write("flight.json", R"({"track": {"frame": "local", "crs": "EPSG:25832", "point": "body"}})");
  expect_error("are only for the frame crs");
  write("flight.json", R"({"track": {"frame": "crs", "crs": "EPSG:2056", "point": "body"}})");
  expect_error("flight.json: track: ");
  write("flight.json",
        R"({"track": {"frame": "crs", "crs": "EPSG:25832", "heights": "msl", "point": "body"}})");
  expect_error("heights 'msl'");
}

TEST_F(FlightFolder, ReadsPosesOutOfTheRanges) {
  write("flight.json", k_local);
  write("ranges.csv", "t_s,anchor_id,range_m,x_m,y_m,z_m,qx,qy,qz,qw\n1,7,2.5,0.1,0.2,0.3,0,0,0,1\n");
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().fixes.at(0).local_m, Eigen::Vector3d(0.1, 0.2, 0.3));
  EXPECT_EQ(read.value().ranges.at(0).antenna, 1);
  EXPECT_EQ(read.value().fixes.at(0).fix, FixClass::rtk_fixed);  // motion capture
}

TEST_F(FlightFolder, ReadsGzipAndWindowsLineEnds) {
  globe();
  fs::remove(folder_ / "ranges.csv");
  const std::string text = "\xEF\xBB\xBFt_s,anchor_id,range_m\r\n0.1,3,6.14\r\n\r\n";
  gzFile gz = gzopen((folder_ / "ranges.csv.gz").c_str(), "wb");
  gzwrite(gz, text.data(), static_cast<unsigned>(text.size()));
  gzclose(gz);
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(read.value().ranges.size(), 1U);
}

TEST_F(FlightFolder, NamesFileAndLineOfABadNumber) {
  globe();
  write("ranges.csv", "t_s,anchor_id,range_m\n0.1,3,6.14\n0.2,3,six\n");
  expect_error("ranges.csv:3: range_m: 'six' is not a number");
}

TEST_F(FlightFolder, NamesFileAndLineOfAShortRow) {
  globe();
  write("ranges.csv", "t_s,anchor_id,range_m\n0.1,3\n");
  expect_error("ranges.csv:2: 2 fields, the header has 3");
}

TEST_F(FlightFolder, NamesAMissingColumn) {
  globe();
  write("ranges.csv", "t_s,anchor,range_m\n0.1,3,4\n");
  expect_error("column 'anchor_id' is missing");
}

TEST_F(FlightFolder, NamesAnUnknownKey) {
  globe();
  write("flight.json", R"({"kit": "k", "leverarm": 1, "track": {"frame": "local", "point": "body"}})");
  expect_error("unknown key 'leverarm'");
}

TEST_F(FlightFolder, RefusesBrokenJsonDeepJsonAndMissingFiles) {
  globe();
  write("flight.json", "{\"kit\": ");
  expect_error("flight.json");
  write("flight.json", std::string(5000, '[') + std::string(5000, ']'));
  expect_error("flight.json");
  fs::remove(folder_ / "flight.json");
  expect_error("flight.json: does not exist");
  globe();
  fs::remove(folder_ / "track.csv");
  expect_error("neither track.csv nor track.csv.gz");
}

TEST_F(FlightFolder, RefusesATruncatedGzip) {
  globe();
  fs::remove(folder_ / "ranges.csv");
  std::string text = "t_s,anchor_id,range_m\n";
  for (int i = 0; i < 5000; ++i)
    text += std::to_string(i * 0.01) + ",3," + std::to_string(5 + std::sin(i)) + "\n";
  gzFile gz = gzopen((folder_ / "ranges.csv.gz").c_str(), "wb");
  gzwrite(gz, text.data(), static_cast<unsigned>(text.size()));
  gzclose(gz);
  fs::resize_file(folder_ / "ranges.csv.gz", fs::file_size(folder_ / "ranges.csv.gz") / 2);
  EXPECT_NE(error(), "no error");
}

TEST_F(FlightFolder, ListsColumnsItDoesNotKnow) {
  globe();
  write("ranges.csv", "t_s,anchor_id,range_m,moon_phase\n0.1,3,6.14,0.5\n");
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read);
  ASSERT_EQ(read.value().notes.size(), 1U);
  EXPECT_NE(read.value().notes[0].find("moon_phase"), std::string::npos);
}

TEST_F(FlightFolder, NeverOpensTruth) {
  globe();
  write("anchors_truth.csv", "this is not even a table\n\"");
  EXPECT_TRUE(read_flight_folder(folder_));
}

TEST_F(FlightFolder, AsksWhichTagWhenSeveralAreDeclared) {
  globe();
  write("flight.json",
        R"({"track": {"frame": "wgs84", "point": "body"}, "tags": [{"tag_id": "1"}, {"tag_id": "2"}]})");
  expect_error("no column tag_id");
}

TEST_F(FlightFolder, TakesRangesBetweenAnchorsAndWritesThem) {
  globe();
  write("ranges.csv",
        "t_s,tag_id,anchor_id,range_m,kind\n0.1,0x6e01,3,6.14,tag_anchor\n0.2,7,3,9.5,anchor_anchor\n");
  const auto read = read_flight_folder(folder_);
  ASSERT_TRUE(read.has_value()) << read.error().message;
  ASSERT_EQ(read.value().ranges.size(), 2u);
  EXPECT_EQ(read.value().ranges[0].kind, RangeKind::tag_anchor);
  EXPECT_EQ(read.value().ranges[1].kind, RangeKind::anchor_anchor);
  EXPECT_EQ(read.value().ranges[1].tag, NetworkId{7});
  const auto copy = folder_ / "copy";
  ASSERT_TRUE(write_flight_folder(read.value(), copy).has_value());
  const auto again = read_flight_folder(copy);
  ASSERT_TRUE(again.has_value()) << again.error().message;
  EXPECT_EQ(again.value().ranges[1].kind, RangeKind::anchor_anchor);
  EXPECT_EQ(again.value().ranges[1].distance_m, 9.5);
  write("ranges.csv", "t_s,tag_id,anchor_id,range_m,kind\n0.1,0x6e01,3,6.14,sideways\n");
  const auto bad = read_flight_folder(folder_);
  ASSERT_FALSE(bad.has_value());
  EXPECT_NE(bad.error().message.find("anchor_anchor"), std::string::npos);
}

TEST_F(FlightFolder, KeepsHowWellTheLeverArmWasMeasured) {
  globe();
  const auto declare = [&](const std::string& sigma) {
    write("flight.json",
          R"({"track": {"frame": "wgs84", "point": "body"}, "lever_arm_sigma_m": )" + sigma + "}");
  };
  ASSERT_TRUE(write_flight_folder(read_flight_folder(folder_).value(), folder_ / "unsaid"));
  EXPECT_FALSE(read_flight_folder(folder_ / "unsaid").value().mission.lever_arm_sigma_m.has_value());
  declare("0.02");
  const FlightData flight = read_flight_folder(folder_).value();
  EXPECT_EQ(flight.mission.lever_arm_sigma_m, 0.02);
  ASSERT_TRUE(write_flight_folder(flight, folder_ / "copy"));
  EXPECT_EQ(read_flight_folder(folder_ / "copy").value().mission.lever_arm_sigma_m, 0.02);
  for (const char* refused : {"0", "-0.02", "10.5", "\"0.02\"", "[0.02]"}) {
    declare(refused);
    expect_error("'lever_arm_sigma_m' must be 0.001 to 10 m");
  }
}

TEST_F(FlightFolder, WritesWhatItReads) {
  globe();
  const FlightData first = read_flight_folder(folder_).value();
  ASSERT_TRUE(write_flight_folder(first, folder_ / "copy"));
  const auto second = read_flight_folder(folder_ / "copy");
  ASSERT_TRUE(second) << second.error().message;
  ASSERT_EQ(second.value().fixes.size(), first.fixes.size());
  ASSERT_EQ(second.value().ranges.size(), first.ranges.size());
  for (std::size_t i = 0; i < first.fixes.size(); ++i) {
    EXPECT_EQ(second.value().fixes[i].time, first.fixes[i].time);
    EXPECT_EQ(second.value().fixes[i].fix, first.fixes[i].fix);
    EXPECT_NEAR(second.value().fixes[i].position.lat_deg, first.fixes[i].position.lat_deg, 1e-10);
    EXPECT_LT(second.value().fixes[i].enu_from_body->angularDistance(*first.fixes[i].enu_from_body), 1e-6);
  }
  for (std::size_t i = 0; i < first.ranges.size(); ++i) {
    EXPECT_EQ(second.value().ranges[i].time, first.ranges[i].time);
    EXPECT_EQ(second.value().ranges[i].anchor, first.ranges[i].anchor);
    EXPECT_NEAR(second.value().ranges[i].distance_m, first.ranges[i].distance_m, 1e-4);
  }
  EXPECT_EQ(second.value().anchor_names, first.anchor_names);
}

TEST(KitProfileJson, ComesBackAsItWent) {
  KitProfile profile;
  profile.kit = "hexacopter 2";
  ProfileFactor factor;
  factor.flight = "tuesday";
  factor.information = Eigen::Vector4d(400, 30, 900, 12).asDiagonal();
  factor.information(0, 1) = factor.information(1, 0) = -7.25;
  factor.information_mean = {80, 1.5, -160, 0.125};
  profile.factors.push_back(factor);
  const auto back = parse_kit_profile(kit_profile_json(profile));
  ASSERT_TRUE(back) << back.error().message;
  EXPECT_EQ(back.value().kit, profile.kit);
  EXPECT_EQ(back.value().factors.at(0).information, factor.information);
  EXPECT_EQ(back.value().factors.at(0).information_mean, factor.information_mean);
}

TEST(KitProfileJson, NamesWhatIsWrong) {
  EXPECT_FALSE(parse_kit_profile("nonsense"));
  EXPECT_FALSE(parse_kit_profile(R"({"schema": "anchord.kit_profile/2", "kit": "k", "factors": []})"));
  const auto typo = parse_kit_profile(R"({"schema": "anchord.kit_profile/1", "kit": "k", "factor": []})");
  EXPECT_NE(typo.error().message.find("unknown key 'factor'"), std::string::npos);
}

}  // namespace
}  // namespace anchord::flight_folder_test
