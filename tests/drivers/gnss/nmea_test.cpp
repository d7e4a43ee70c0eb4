#include "drivers/gnss/nmea.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "samples.hpp"

namespace anchord::gnss::nmea_test {
namespace {

using namespace test;

// The example and its result are those of the format's description.
TEST(Nmea, DecodesAnRtkEpoch) {
  const auto epochs = decode(k_rmc + k_gga + k_gst);
  ASSERT_EQ(epochs.size(), 1U);
  const auto& e = epochs[0];
  EXPECT_EQ(to_rfc3339(e.time.value()), "2024-06-13T09:00:00.200000Z");
  EXPECT_NEAR(e.lat_deg.value(), 51.022812300, 1e-9);
  EXPECT_NEAR(e.lon_deg.value(), 3.710456700, 1e-9);
  EXPECT_NEAR(e.height_msl_m.value(), 22.500, 1e-9);
  EXPECT_NEAR(e.height_ellipsoid_m.value(), 67.512, 1e-9);
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_EQ(e.satellites, 14);
  EXPECT_EQ(e.hdop, 0.9);
  EXPECT_EQ(e.age_s, 0.8);
  // 0.014 and 0.009 stand in an order that depends on the maker: the larger serves for both.
  EXPECT_EQ(e.sigma_n_m, 0.014);
  EXPECT_EQ(e.sigma_e_m, 0.014);
  EXPECT_EQ(e.sigma_u_m, 0.021);
}

TEST(Nmea, KeepsTheStandardOrderOfSigmasOnDemand) {
  DecoderOptions options;
  options.gst_order = nmea::GstOrder::standard;
  const auto epochs = decode(k_rmc + k_gga + k_gst, options);
  EXPECT_EQ(epochs.at(0).sigma_n_m, 0.014);
  EXPECT_EQ(epochs.at(0).sigma_e_m, 0.009);
}

TEST(Nmea, DecodesTheFloatingEpochOfReach) {
  const auto epochs = decode(
      "$GNRMC,235954.00,A,5101.3727833,N,00342.6265993,E,7.63,277.84,150624,,,D*4C\n"
      "$GNGGA,235954.00,5101.3727833,N,00342.6265993,E,5,14,0.9,18.614,M,44.962,M,0.8,*6A\n"
      "$GNGST,235954.00,0.400,,,,0.170,0.310,0.550*6B\n"
      "$GNVTG,277.84,T,,M,7.63,N,14.13,K,A*18\n");
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_EQ(epochs[0].fix, FixClass::rtk_float);
  EXPECT_NEAR(epochs[0].lat_deg.value(), 51.022879722, 1e-9);
  EXPECT_NEAR(epochs[0].lon_deg.value(), 3.710443322, 1e-9);
  EXPECT_NEAR(epochs[0].height_ellipsoid_m.value(), 63.576, 1e-9);
}

TEST(Nmea, EmptyFieldsAreAbsentNotZero) {
  const auto epochs = decode(
      "$GNRMC,,,,,,,,,,,,*55\r\n$GNGGA,,,,,,,,,,,,,,*48\r\n$GNGST,,,,,,,,,*65\r\n$GNVTG,,,,,,,*60\r\n"
      "$GNRMC,,,,,,,,,,,,*55\r\n$GNGGA,,,,,,,,,,,,,,*48\r\n$GNGST,,,,,,,,,*65\r\n$GNVTG,,,,,,,*60\r\n"
      "$GNGGA,,,,,,0,00,99.99,,,,,,*56\r\n");
  ASSERT_EQ(epochs.size(), 3U);
  for (const auto& e : epochs) {
    EXPECT_EQ(e.fix, FixClass::none);
    EXPECT_FALSE(e.time || e.lat_deg || e.lon_deg || e.height_ellipsoid_m || e.sigma_e_m);
  }
}

std::string gga(const char* time, const char* quality = "4") {
  return sentence(std::string("GNGGA,") + time + ",5101.0,N,00342.0,E," + quality +
                  ",14,0.9,22.5,M,45.0,M,0.8,");
}

TEST(Nmea, RunsTheDateOnOverMidnightWhileOnlyGgaComes) {
  const auto epochs = decode(sentence("GNRMC,235959.80,A,5101.0,N,00342.0,E,0,0,311223,,,D") +
                             gga("235959.80") + gga("000000.00") + gga("000000.20"));
  ASSERT_EQ(epochs.size(), 3U);
  EXPECT_EQ(to_rfc3339(*epochs[0].time), "2023-12-31T23:59:59.800000Z");
  EXPECT_EQ(to_rfc3339(*epochs[1].time), "2024-01-01T00:00:00.000000Z");
  EXPECT_EQ(to_rfc3339(*epochs[2].time), "2024-01-01T00:00:00.200000Z");
}

TEST(Nmea, GivesEpochsBeforeTheFirstDateTheirDateAfterwards) {
  const auto epochs = decode(gga("235959.80") + gga("000000.00") +
                             sentence("GNZDA,000000.20,01,01,2024,00,00") + gga("000000.20"));
  ASSERT_EQ(epochs.size(), 3U);
  EXPECT_EQ(to_rfc3339(*epochs[0].time), "2023-12-31T23:59:59.800000Z");
  EXPECT_EQ(to_rfc3339(*epochs[2].time), "2024-01-01T00:00:00.200000Z");
}

TEST(Nmea, SaysOnlyTheTimeOfDayWhenNothingEverGivesADate) {
  const auto epochs = decode(gga("120000.00"));
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_FALSE(epochs[0].time);
  EXPECT_EQ(epochs[0].time_of_day_ns, 12LL * 3600 * 1'000'000'000);
  EXPECT_FALSE(to_fix(epochs[0], {}));
}

TEST(Nmea, TakesALeapSecondAsTheNextMinute) {
  const auto epochs = decode(sentence("GNZDA,235960.00,31,12,2016,00,00") + gga("235960.00"));
  EXPECT_EQ(to_rfc3339(epochs.at(0).time.value()), "2017-01-01T00:00:00.000000Z");
}

TEST(Nmea, CarriesSigmasTwoSecondsAndOnlyWhileTheQualityStays) {
  const std::string gst = sentence("GNGST,120000.00,,,,,0.01,0.01,0.02");
  const auto epochs =
      decode(gga("120000.00") + gst + gga("120001.80") + gga("120002.20") + gga("120002.40", "5"));
  ASSERT_EQ(epochs.size(), 4U);
  EXPECT_EQ(epochs[1].sigma_u_m, 0.02);
  EXPECT_FALSE(epochs[2].sigma_u_m);
  const auto changed = decode(gga("120000.00") + gst + gga("120000.20", "5"));
  EXPECT_FALSE(changed.at(1).sigma_u_m);
}

TEST(Nmea, SkipsARepeatedEpoch) {
  Skips skips;
  EXPECT_EQ(decode(gga("120000.00") + gga("120000.00") + gga("120000.00"), {}, &skips).size(), 1U);
  EXPECT_EQ(skips["nmea: same time again"], 2U);
}

struct Quality {
  const char* digit;
  FixClass fix;
};
class NmeaQuality : public testing::TestWithParam<Quality> {};
TEST_P(NmeaQuality, GivesItsFixClass) {
  const auto e = decode(gga("120000.00", GetParam().digit)).at(0);
  EXPECT_EQ(e.fix, GetParam().fix);
  EXPECT_EQ(e.lat_deg.has_value(), GetParam().fix != FixClass::none);
}
INSTANTIATE_TEST_SUITE_P(All, NmeaQuality,
                         testing::Values(Quality{"0", FixClass::none}, Quality{"1", FixClass::single},
                                         Quality{"2", FixClass::dgps}, Quality{"3", FixClass::single},
                                         Quality{"4", FixClass::rtk_fixed}, Quality{"5", FixClass::rtk_float},
                                         Quality{"6", FixClass::none}, Quality{"8", FixClass::none},
                                         Quality{"9", FixClass::none}, Quality{"", FixClass::none}));

TEST(Nmea, RefusesWhatIsOutOfItsDomainThoughTheChecksumIsRight) {
  for (const char* text :
       {"GNGGA,250000.00,5101.0,N,00342.0,E,4,14,0.9,22.5,M,45.0,M,0.8,",   // hour 25
        "GNGGA,120000.00,5160.0,N,00342.0,E,4,14,0.9,22.5,M,45.0,M,0.8,",   // 60 minutes
        "GNGGA,120000.00,9101.0,N,00342.0,E,4,14,0.9,22.5,M,45.0,M,0.8,",   // beyond the pole
        "GNGGA,120000.00,5101.0,X,00342.0,E,4,14,0.9,22.5,M,45.0,M,0.8,",   // no such side
        "GNGGA,120000.00,5101.0,N,00342.0,E,4,14,0.9,nan,M,45.0,M,0.8,",    // not a number
        "GNGGA,120000.00,5101.0,N,00342.0,E,4,14,0.9,73.8,F,45.0,M,0.8,",   // feet
        "GNGGA,120000.00,5101.0,N,00342.0,E,4,14,0.9,22.5,M,147.6,F,0.8,",  // feet
        "GNGGA,120000.00,5101.0,N",                                         // cut short
        "GNRMC,120000.00,A,5101.0,N,00342.0,E,0,0,310224,,,D",              // 31 February
        "GNGST,120000.00,,,,,-0.01,0.01,0.02"}) {
    Skips skips;
    EXPECT_TRUE(decode(sentence(text), {}, &skips).empty()) << text;
    EXPECT_EQ(skips["nmea: field not readable"], 1U) << text;
  }
}

// SiRF before its first fix: a latitude that cannot be, marked as no fix. The time is good all the same.
TEST(Nmea, TakesTheTimeOfASentenceWhosePositionIsAPlaceholder) {
  Skips skips;
  const auto epochs = decode(sentence("GPGGA,235946.00,8960.000000,N,00000.0,E,0,0,,137.0,M,13.0,M,,") +
                                 sentence("GPRMC,235946.00,V,36000.0,N,72000.0,E,0.0,,190120,,,N"),
                             {}, &skips);
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_EQ(to_rfc3339(epochs[0].time.value()), "2020-01-19T23:59:46.000000Z");
  EXPECT_EQ(epochs[0].fix, FixClass::none);
  EXPECT_FALSE(epochs[0].lat_deg || epochs[0].height_msl_m);
  EXPECT_TRUE(skips.entries().empty());
}

TEST(Nmea, UsesRmcAloneWhereNoGgaComes) {
  const auto e = decode(sentence("GNRMC,120000.00,A,5101.0,N,00342.0,E,0,0,130624,,,R")).at(0);
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_FALSE(e.height_ellipsoid_m);
  EXPECT_TRUE(decode(sentence("GNRMC,120000.00,V,,,,,,,130624,,,N")).empty());
}

TEST(NmeaFraming, AcceptsTagBlocksLowerCaseAndLeadingNoise) {
  Skips skips;
  std::string lower = k_gga;
  EXPECT_EQ(decode("noise\xff\xfe" + k_rmc + "\\s:x*00\\" + lower, {}, &skips).size(), 1U);
  EXPECT_GT(skips["byte outside any frame"], 0U);
  std::string rmc = k_rmc;
  rmc.replace(rmc.find("D*47"), 4, "D*47");
  std::string gst = "$GNGST,235954.00,0.400,,,,0.170,0.310,0.550*6b\n";  // lower-case checksum
  Skips none;
  decode(gst, {}, &none);
  EXPECT_TRUE(none.entries().empty());
}

TEST(NmeaFraming, RejectsMissingAndWrongChecksumsByName) {
  Skips skips;
  std::string wrong = k_gga, missing = k_gga.substr(0, k_gga.find('*')) + "\r\n";
  wrong[20] = '9';
  const auto epochs = decode(wrong + missing + "$GNGG" + k_rmc + k_gga, {}, &skips);
  EXPECT_EQ(epochs.size(), 1U);
  EXPECT_EQ(skips["nmea: checksum wrong"], 1U);
  EXPECT_EQ(skips["nmea: no checksum"], 1U);
  EXPECT_EQ(skips["nmea: another sentence starts inside"], 1U);
}

// GNS instead of GGA: some makers send nothing else with a height. By NMEA 0183 4.x its fields 9 and 10 are
// height and separation without units between, and field 6 has a letter per system.
TEST(Nmea, TakesThePositionOfGnsWhereNoGgaComes) {
  const auto e = decode(sentence("GNZDA,120000.00,13,06,2024,00,00") +
                        sentence("GNGNS,120000.00,5101.5,N,00342.6,E,RRNN,14,0.9,22.5,45.0,0.8,0000,S"))
                     .at(0);
  EXPECT_EQ(to_rfc3339(e.time.value()), "2024-06-13T12:00:00.000000Z");
  EXPECT_NEAR(e.lat_deg.value(), 51.025, 1e-12);
  EXPECT_NEAR(e.lon_deg.value(), 3.71, 1e-12);
  EXPECT_EQ(e.height_msl_m, 22.5);
  EXPECT_EQ(e.height_ellipsoid_m, 67.5);
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_EQ(e.satellites, 14);
  EXPECT_EQ(e.age_s, 0.8);
}

TEST(Nmea, PrefersGgaToGnsOfTheSameTime) {
  const auto epochs = decode(sentence("GNGNS,120000.00,5101.5,N,00342.6,E,AA,9,1.1,22.0,45.0,,,S") +
                             gga("120000.00") + sentence("GNGNS,120000.00,,,,,AA,9,1.1,,,,,S"));
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_EQ(epochs[0].fix, FixClass::rtk_fixed);
  EXPECT_EQ(epochs[0].satellites, 14);
}

TEST(Nmea, ReadsTheBestModeLetterOfGns) {
  for (const auto& [modes, fix] : {std::pair{"RFN", FixClass::rtk_fixed},
                                   {"FD", FixClass::rtk_float},
                                   {"DA", FixClass::dgps},
                                   {"NA", FixClass::single},
                                   {"P", FixClass::single},
                                   {"EN", FixClass::none},
                                   {"S", FixClass::none},
                                   {"NNN", FixClass::none}}) {
    const auto e =
        decode(sentence("GNGNS,120000.00,5101.5,N,00342.6,E," + std::string(modes) + ",14,0.9,22.5,45.0,,"))
            .at(0);
    EXPECT_EQ(e.fix, fix) << modes;
    EXPECT_EQ(e.lat_deg.has_value(), fix != FixClass::none) << modes;
  }
}

TEST(Nmea, SaysWhyAPositionThatWasNotMeasuredIsMissing) {
  Skips skips;
  EXPECT_EQ(decode(gga("120000.00", "6") + gga("120001.00", "8") + gga("120002.00", "5"), {}, &skips).size(),
            3U);
  EXPECT_EQ(skips["nmea: quality 6 to 9, dead reckoning or not measured"], 2U);
}

// $PUBX,03 and their like are longer than the 256 bytes that positions need, and no noise.
TEST(NmeaFraming, TakesLongSentencesOfAMakersOwn) {
  std::string satellites = "PUBX,03,32";
  for (int i = 0; i < 32; ++i) satellites += ",12,U,207,43,28,009";
  Skips skips;
  EXPECT_EQ(decode(sentence(satellites) + k_rmc + k_gga, {}, &skips).size(), 1U);
  EXPECT_TRUE(skips.entries().empty());
  decode("$" + std::string(2000, 'A') + "\r\n", {}, &skips);
  EXPECT_EQ(skips["nmea: longer than 1024 bytes"], 1U);
}

}  // namespace
}  // namespace anchord::gnss::nmea_test
