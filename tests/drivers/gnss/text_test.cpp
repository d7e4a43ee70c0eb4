#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "samples.hpp"

namespace anchord::gnss::text_test {
namespace {

using namespace test;

const std::string k_llh_header =
    "%  UTC                   latitude(deg) longitude(deg)  height(m)   Q  ns   sdn(m)   sde(m)   sdu(m)  "
    "sdne(m)  "
    "sdeu(m)  sdun(m) age(s)  ratio\n";
const std::string k_llh_float =
    "2024/06/15 23:59:51.000   51.022827740    3.710564222    62.7980   5  14   2.1000   1.4000   4.0000  "
    "-0.0001   "
    "0.0001   0.0005   0.00    0.0\n";
const std::string k_llh_fixed =
    "2024/06/16 00:00:13.600   51.022874322    3.710416541    61.0000   1  13   0.0140   0.0090   0.0210   "
    "0.0000  "
    "-0.0000  -0.0000   1.10   12.5\n";

TEST(Llh, DecodesTheExamples) {
  const auto epochs = decode(k_llh_header + k_llh_float + k_llh_fixed);
  ASSERT_EQ(epochs.size(), 2U);
  EXPECT_EQ(epochs[0].fix, FixClass::single);  // 5 is float in NMEA and single here
  const auto& e = epochs[1];
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_EQ(to_rfc3339(e.time.value()), "2024-06-16T00:00:13.600000Z");
  EXPECT_EQ(e.lat_deg, 51.022874322);
  EXPECT_EQ(e.lon_deg, 3.710416541);
  EXPECT_EQ(e.height_ellipsoid_m, 61.0);
  EXPECT_FALSE(e.height_msl_m);
  EXPECT_EQ(e.satellites, 13);
  EXPECT_EQ(e.sigma_n_m, 0.014);  // order north, east, up
  EXPECT_EQ(e.sigma_e_m, 0.009);
  EXPECT_EQ(e.sigma_u_m, 0.021);
  EXPECT_EQ(e.age_s, 1.1);
}

TEST(Llh, ReadsCovariancesAsSignedRoots) {
  const auto e =
      decode("2024/06/16 00:00:13.600 51.0 3.7 61.0 2 13 0.3 0.2 0.5 -0.1 0.15 0.2 1.1 12.5\n").at(0);
  EXPECT_NEAR(e.covariance_enu_m2.value()(0, 1), -0.01, 1e-12);
  EXPECT_NEAR(e.covariance_enu_m2.value()(0, 2), 0.0225, 1e-12);
  EXPECT_NEAR(e.covariance_enu_m2.value()(1, 2), 0.04, 1e-12);
}

TEST(Llh, TakesTheTimeSystemAndHeightFromTheHeader) {
  std::string header = k_llh_header;
  header.replace(3, 4, "GPST");
  // 18 leap seconds in 2024, 13 in 2005.
  EXPECT_EQ(to_rfc3339(decode(header + k_llh_fixed).at(0).time.value()), "2024-06-15T23:59:55.600000Z");
  std::string old = k_llh_fixed;
  old.replace(0, 4, "2005");
  EXPECT_EQ(to_rfc3339(decode(header + old).at(0).time.value()), "2005-06-16T00:00:00.600000Z");
  const auto e = decode("% (lat/lon/height=WGS84/geodetic,Q=1:fix)\n" + k_llh_fixed).at(0);
  EXPECT_FALSE(e.height_ellipsoid_m);
  EXPECT_EQ(e.height_msl_m, 61.0);
}

TEST(Llh, ReadsDegreesMinutesSecondsAndOtherSeparators) {
  const auto e =
      decode("2024/06/16 00:00:13.600,-0,30,36.00000,3,45,18.00000,61.0,1,13,0.01,0.01,0.02,0,0,0,1.1,12.5\n")
          .at(0);
  EXPECT_NEAR(e.lat_deg.value(), -0.51, 1e-12);
  EXPECT_NEAR(e.lon_deg.value(), 3.755, 1e-12);
  EXPECT_EQ(e.height_ellipsoid_m, 61.0);
}

TEST(Llh, RefusesLinesItCannotTrust) {
  for (const char* line :
       {"2024/06/16 00:00:13.600 51.0 3.7 61.0 1 13 0.01 0.01\n",                      // short
        "2024/06/16 00:00:13.600 51.0 3.7 61.0 8 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n",  // Q 8
        "2024/06/16 00:00:13.600 51.0 3.7x 61.0 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n",
        "2024/06/31 00:00:13.600 51.0 3.7 61.0 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n",
        "4/06/16 00:00:13.600 51.0 3.7 61.0 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n",  // joined late
        "2024/06/16 00:00:13.600 95.0 3.7 61.0 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n"}) {
    Skips skips;
    EXPECT_TRUE(decode(line, {}, &skips).empty()) << line;
    EXPECT_EQ(skips["llh: line not readable"], 1U) << line;
  }
}

TEST(Llh, SaysThatEcefColumnsHoldNoGeodeticPosition) {
  Skips skips;
  EXPECT_TRUE(
      decode("%  UTC  x-ecef(m) y-ecef(m) z-ecef(m) Q ns sdx(m) sdy(m) sdz(m) sdxy sdyz sdzx age(s) ratio\n"
             "2024/06/16 00:00:13.600 4000000.0 300000.0 4900000.0 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n",
             {}, &skips)
          .empty());
  EXPECT_EQ(skips["llh: no WGS84 position"], 1U);
}

// rnx2rtkp -u writes the second of the week in UTC too: 18 s before GPS time in 2024.
TEST(Llh, ShiftsTheSecondOfTheWeekWhereTheHeaderSaysUtc) {
  const std::string line = "2319 8.000 51.0 3.7 62.8 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n";
  EXPECT_EQ(to_rfc3339(decode(k_llh_header + line).at(0).time.value()), "2024-06-16T00:00:08.000000Z");
  EXPECT_EQ(to_rfc3339(decode(line).at(0).time.value()), "2024-06-15T23:59:50.000000Z");
}

TEST(Llh, KnowsTheColumnsOfAHeaderWithoutRatio) {
  EXPECT_EQ(
      to_rfc3339(decode("%  GPST  latitude(deg) longitude(deg)  height(m)   Q  ns sdn(m)\n" + k_llh_fixed)
                     .at(0)
                     .time.value()),
      "2024-06-15T23:59:55.600000Z");
  EXPECT_EQ(
      to_rfc3339(
          decode("%  GPST,latitude(deg),longitude(deg),height(m),Q,ns\n" + k_llh_fixed).at(0).time.value()),
      "2024-06-15T23:59:55.600000Z");
}

TEST(Llh, TakesTimeWithoutAHeaderForUtcUnlessTold) {
  Decoder reach;
  Epochs epochs;
  reach.feed(k_llh_fixed, epochs);
  EXPECT_EQ(reach.llh_time_assumed(), 1U);
  EXPECT_EQ(to_rfc3339(epochs.at(0).time.value()), "2024-06-16T00:00:13.600000Z");
  reach.feed(k_llh_header + k_llh_fixed, epochs);
  EXPECT_EQ(reach.llh_time_assumed(), 1U);
  DecoderOptions options;
  options.llh_time = llh::TimeSystem::gpst;
  EXPECT_EQ(to_rfc3339(decode(k_llh_fixed, options).at(0).time.value()), "2024-06-15T23:59:55.600000Z");
}

// As tools print that read and rewrite such files.
TEST(Llh, ReadsCountsThatAreWrittenAsDecimals) {
  const auto e =
      decode("2024/06/16 00:00:13.600 51.0 3.7 61.0 2.0000000 13.0000000 0.3 0.2 0.5 0 0 0 1.1 12.5\n").at(0);
  EXPECT_EQ(e.fix, FixClass::rtk_float);
  EXPECT_EQ(e.satellites, 13);
  EXPECT_TRUE(decode("2024/06/16 00:00:13.600 51.0 3.7 61.0 1.5 13 0.3 0.2 0.5 0 0 0 1.1 12.5\n").empty());
}

// rnx2rtkp -a, or a stream of it joined late: 12 m east and 5 m south of the base, in four decimals.
TEST(Llh, TakesNoShortBaselineWithoutAHeaderForDegrees) {
  const std::string line =
      "2024/06/16 00:00:13.600 12.3456 -4.5678 1.2345 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n";
  Skips skips;
  EXPECT_TRUE(decode(line, {}, &skips).empty());
  EXPECT_EQ(skips["llh: no WGS84 position"], 1U);
  EXPECT_EQ(decode(k_llh_header + line).size(), 1U);
  EXPECT_TRUE(decode("128, 64, 32, 16, 8, 4, 2, 1, 0, 0, 0, 0, 0, 0, 0\n").empty());  // a table of anything
}

TEST(Llh, RefusesAnotherDatum) {
  Skips skips;
  EXPECT_TRUE(
      decode("% (lat/lon/height=Tokyo/ellipsoidal,Q=1:fix)\n" + k_llh_header + k_llh_fixed, {}, &skips)
          .empty());
  EXPECT_EQ(skips["llh: no WGS84 position"], 1U);
}

TEST(Llh, DoesNotUseALineWhoseEndIsMissing) {
  Skips skips;
  EXPECT_TRUE(decode(k_llh_fixed.substr(0, k_llh_fixed.size() - 3), {}, &skips).empty());
  EXPECT_EQ(skips["llh: cut off at the end"], 1U);
}

TEST(Detection, TakesEveryFormatOfOneStream) {
  const auto epochs = decode(k_gga + k_pvt + k_hp + erb_epoch() + k_llh_fixed + k_tpv);
  ASSERT_EQ(epochs.size(), 5U);
  EXPECT_EQ(decode(k_rmc + k_gga + k_pvt + k_hp, {Protocol::ubx, {}, {}}).size(), 1U);
}

TEST(Detection, FindsSentencesBehindALoggersTimeStamp) {
  EXPECT_EQ(decode("2024-06-13 09:00:00.123 " + k_rmc + "2024-06-13 09:00:00.124 " + k_gga).size(), 1U);
}

// Windows editors put the mark before the text. It hid the header, and GPS time was then read as UTC.
TEST(Detection, AByteOrderMarkHidesNothing) {
  std::string header = k_llh_header;
  header.replace(3, 4, "GPST");
  Skips skips;
  const auto epochs = decode("\xef\xbb\xbf" + header + k_llh_fixed, {}, &skips);
  EXPECT_EQ(to_rfc3339(epochs.at(0).time.value()), "2024-06-15T23:59:55.600000Z");
  EXPECT_TRUE(skips.entries().empty());
  EXPECT_EQ(decode("\xef\xbb\xbf" + k_tpv).size(), 1U);
  for (std::size_t cut = 1; cut < 4; ++cut) {
    Decoder decoder;
    Epochs out;
    const auto whole = "\xef\xbb\xbf" + k_tpv;
    decoder.feed(whole.substr(0, cut), out);
    decoder.feed(whole.substr(cut), out);
    decoder.finish(out);
    EXPECT_EQ(out.size(), 1U) << cut;
  }
}

// gpspipe -wt and loggers write their own time before each report.
TEST(Detection, FindsReportsBehindALoggersTimeStamp) {
  EXPECT_EQ(decode("2024-06-15 23:59:54: " + k_tpv).size(), 1U);
  EXPECT_EQ(decode("[1718495994.5] " + k_tpv).size(), 1U);
  Skips skips;
  EXPECT_TRUE(decode("a {brace} is nothing rare {\n", {}, &skips).empty());
  EXPECT_EQ(skips["gpsd: line not readable"], 0U);
}

}  // namespace
}  // namespace anchord::gnss::text_test
