#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "samples.hpp"

namespace anchord::gnss::gpsd_test {
namespace {

using namespace test;

TEST(Gpsd, DecodesAFloatingEpochWithItsSigmas) {
  const auto epochs =
      decode(R"({"class":"VERSION","release":"3.22","rev":"3.22","proto_major":3,"proto_minor":14})"
             "\r\n"
             R"({"class":"SKY","hdop":0.9,"uSat":14})"
             "\r\n"
             R"({"class":"TPV","device":"udp://127.0.0.1:29471","mode":1})"
             "\r\n"
             R"({"class":"GST","device":"udp://127.0.0.1:29471"})"
             "\r\n" +
             k_tpv +
             R"({"class":"GST","time":"2024-06-15T23:59:54.000Z","rms":0.4,"lat":0.17,"lon":0.31,"alt":0.55})"
             "\r\n");
  ASSERT_EQ(epochs.size(), 1U);
  const auto& e = epochs[0];
  EXPECT_EQ(e.fix, FixClass::rtk_float);  // status 4; NMEA's 4 would be fixed
  EXPECT_EQ(e.lat_deg, 51.022879722);
  EXPECT_EQ(e.height_ellipsoid_m, 63.576);
  EXPECT_EQ(e.height_msl_m, 18.614);
  EXPECT_EQ(e.sigma_e_m, 0.31);
  EXPECT_EQ(e.sigma_n_m, 0.31);
  EXPECT_EQ(e.sigma_u_m, 0.55);
  EXPECT_EQ(e.satellites, 14);
  EXPECT_EQ(e.hdop, 0.9);
}

TEST(Gpsd, MergesSeveralReportsOfOneTimeAndIgnoresEph) {
  const auto epochs = decode(
      R"({"class":"TPV","mode":2,"time":"2024-06-15T23:59:54.000Z","lat":51.02,"lon":3.71})"
      "\n" +
      k_tpv +
      R"({"class":"TPV","mode":3,"status":3,"time":"2024-06-15T23:59:54.200Z","lat":51.02,"lon":3.71,"altHAE":63.5,"eph":4.275})"
      "\n");
  ASSERT_EQ(epochs.size(), 2U);
  EXPECT_EQ(epochs[0].height_ellipsoid_m, 63.576);
  EXPECT_EQ(epochs[1].fix, FixClass::rtk_fixed);
  EXPECT_FALSE(epochs[1].sigma_e_m);
}

TEST(Gpsd, DropsPositionsWithoutTimeAndOldHeights) {
  const auto epochs =
      decode(R"({"class":"TPV","mode":3,"lat":51.02,"lon":3.71,"altHAE":63.5})"
             "\n"
             R"({"class":"TPV","mode":3,"time":"2024-06-15T23:59:54.200Z","lat":51.02,"lon":3.71,"alt":63.5})"
             "\n");
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_FALSE(epochs[0].height_ellipsoid_m);  // "alt" was either height, by version
}

std::string tpv(const char* device, const char* time, const char* rest) {
  return std::string(R"({"class":"TPV","device":")") + device + R"(","time":"2024-06-15T23:59:)" + time +
         "Z\"" + rest + "}\n";
}

// Two receivers at one gpsd, of the same second: one position must not be made of both.
TEST(Gpsd, KeepsItsDevicesApart) {
  const auto epochs = decode(
      tpv("/dev/a", "54.000", R"(,"mode":3,"status":3,"lat":51.0,"lon":3.0,"altHAE":60.0)") +
      tpv("/dev/b", "54.000", R"(,"mode":2,"lat":52.0,"lon":4.0)") +
      R"({"class":"GST","device":"/dev/b","time":"2024-06-15T23:59:54.000Z","lat":2.0,"lon":3.0,"alt":4.0})"
      "\n" +
      tpv("/dev/a", "55.000", R"(,"mode":1)") + tpv("/dev/b", "55.000", R"(,"mode":1)"));
  ASSERT_EQ(epochs.size(), 4U);
  EXPECT_EQ(epochs[0].lat_deg, 52.0);  // b, with its GST
  EXPECT_FALSE(epochs[0].height_ellipsoid_m);
  EXPECT_EQ(epochs[0].sigma_n_m, 3.0);
  EXPECT_EQ(epochs[1].lat_deg, 51.0);
  EXPECT_EQ(epochs[1].fix, FixClass::rtk_fixed);
  EXPECT_FALSE(epochs[1].sigma_n_m);
}

// gpsd 3.23 and later tell DOPs and satellites in two SKY; before 3.21 there is no uSat.
TEST(Gpsd, JoinsTheSkyReportsOfNewAndOldServers) {
  const auto e =
      decode(
          R"({"class":"SKY","device":"udp://127.0.0.1:29471","hdop":0.8,"pdop":1.2})"
          "\n"
          R"({"class":"SKY","device":"udp://127.0.0.1:29471","nSat":3,"uSat":2,"satellites":[{"PRN":1,"used":true}]})"
          "\n" +
          k_tpv)
          .at(0);
  EXPECT_EQ(e.hdop, 0.8);
  EXPECT_EQ(e.satellites, 2);
  // clang-format off
  const auto old = decode(R"({"class":"SKY","device":"udp://127.0.0.1:29471","satellites":[{"PRN":1,"used":true},{"PRN":2,"used":false},{"PRN":3,"used":true},7]})" "\n" + k_tpv);
  // clang-format on
  EXPECT_EQ(old.at(0).satellites, 2);
}

TEST(Gpsd, KeepsAnEpochWhoseFirstReportHasNoPositionYet) {
  Skips skips;
  const auto epochs = decode(tpv("/dev/a", "54.000", R"(,"mode":3,"epv":43.7)") +
                                 tpv("/dev/a", "54.000", R"(,"mode":3,"lat":51.0,"lon":3.0,"altHAE":60.0)") +
                                 tpv("/dev/a", "55.000", R"(,"mode":3)"),
                             {}, &skips);
  ASSERT_EQ(epochs.size(), 2U);
  EXPECT_EQ(epochs[0].lat_deg, 51.0);
  EXPECT_EQ(epochs[1].fix, FixClass::none);
  EXPECT_TRUE(skips.entries().empty());
}

// 7 is a surveyed or typed position (NMEA quality 7): as little measured there as here.
TEST(Gpsd, TakesNoPositionThatWasNotMeasured) {
  for (const char* status : {"5", "7", "8"}) {
    const auto e = decode(tpv("/dev/a", "54.000",
                              (R"(,"mode":3,"lat":51.0,"lon":3.0,"status":)" + std::string(status)).c_str()))
                       .at(0);
    EXPECT_EQ(e.fix, FixClass::none) << status;
    EXPECT_FALSE(e.lat_deg) << status;
  }
}

// As in gpsd_json(5): the newest of each class and device in one object, asked for again and again.
TEST(Gpsd, ReadsAnswersToPoll) {
  const std::string poll =
      R"({"class":"POLL","time":"2024-06-15T23:59:54.900Z","active":1,"tpv":[)"
      R"({"class":"TPV","device":"/dev/a","time":"2024-06-15T23:59:54.000Z","mode":3,)"
      R"("lat":51.0,"lon":3.0,"altHAE":60.0}],)"
      R"("gst":[{"class":"GST","device":"/dev/a","time":"2024-06-15T23:59:54.000Z","lat":0.2,"lon":0.3}],)"
      R"("sky":[{"class":"SKY","device":"/dev/a","hdop":0.9,"uSat":7}]})"
      "\n";
  const auto epochs = decode(poll + poll);
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_EQ(epochs[0].height_ellipsoid_m, 60.0);
  EXPECT_EQ(epochs[0].sigma_e_m, 0.3);
  EXPECT_EQ(epochs[0].satellites, 7);
  EXPECT_TRUE(decode(R"({"class":"POLL","tpv":[1,{}],"gst":7,"sky":[[]]})"
                     "\n")
                  .empty());
}

TEST(Gpsd, CountsPositionsWithoutATime) {
  Skips skips;
  EXPECT_TRUE(decode(R"({"class":"TPV","mode":3,"lat":51.0,"lon":3.0,"altHAE":60.0})"
                     "\n"
                     R"({"class":"TPV","mode":1})"
                     "\n",
                     {}, &skips)
                  .empty());
  EXPECT_EQ(skips["gpsd: position without a time"], 1U);
}

TEST(Gpsd, CountsWhatIsNoReport) {
  Skips skips;
  EXPECT_TRUE(decode("{\"class\":\n{\"x\":1}\n{]\n" + std::string(1000, '{') + "\n", {}, &skips).empty());
  EXPECT_EQ(skips["gpsd: line not readable"], 4U);
}

}  // namespace
}  // namespace anchord::gnss::gpsd_test
