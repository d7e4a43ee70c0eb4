#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "samples.hpp"

namespace anchord::gnss::binary_test {
namespace {

using namespace test;

void put(std::string& to, std::size_t at, std::int64_t value, std::size_t bytes) {
  for (std::size_t i = 0; i < bytes; ++i) to[at + i] = static_cast<char>((value >> (8 * i)) & 0xff);
}
void put_float(std::string& to, std::size_t at, float value) { std::memcpy(&to[at], &value, 4); }

/// A UBX frame of a class and id with zero payload, to be filled in.
std::string ubx(int message_class, int id, std::size_t payload) {
  std::string out = "\xb5\x62";
  out += static_cast<char>(message_class);
  out += static_cast<char>(id);
  out += static_cast<char>(payload & 0xff);
  out += static_cast<char>(payload >> 8);
  return out + std::string(payload, '\0');
}

// Both frames and their meaning are those of the format's description.
TEST(Ubx, JoinsPvtAndHighPrecisionOfOneEpoch) {
  const auto epochs = decode(k_pvt + k_hp);
  ASSERT_EQ(epochs.size(), 1U);
  const auto& e = epochs[0];
  EXPECT_EQ(to_rfc3339(e.time.value()), "2024-06-13T08:59:59.800000Z");  // nano is negative
  EXPECT_NEAR(e.lat_deg.value(), 51.022812312, 1e-12);
  EXPECT_NEAR(e.lon_deg.value(), 3.710456666, 1e-12);
  EXPECT_NEAR(e.height_ellipsoid_m.value(), 67.5123, 1e-9);
  EXPECT_NEAR(e.height_msl_m.value(), 22.4998, 1e-9);
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_EQ(e.satellites, 14);
  EXPECT_NEAR(e.sigma_e_m.value(), 0.0142, 1e-12);
  EXPECT_NEAR(e.sigma_u_m.value(), 0.0213, 1e-12);
}

TEST(Ubx, PublishesPvtAloneWhenTheNextEpochBegins) {
  auto next = k_pvt.substr(0, k_pvt.size() - 2);
  put(next, 6, 378017800 + 200, 4);
  const auto epochs = decode(k_pvt + with_fletcher(next));
  ASSERT_EQ(epochs.size(), 2U);
  EXPECT_NEAR(epochs[0].lat_deg.value(), 51.0228123, 1e-12);
}

TEST(Ubx, TreatsAFixThatIsNotOkAsNone) {
  for (const auto& [at, value] : {std::pair<std::size_t, int>{27, 0x82}, {26, 0}, {26, 5}, {84, 1}}) {
    auto frame = k_pvt.substr(0, k_pvt.size() - 2);
    frame[at] = static_cast<char>(value);  // flags, fixType, flags3 invalidLlh
    const auto e = decode(with_fletcher(frame)).at(0);
    EXPECT_EQ(e.fix, FixClass::none) << at;
    EXPECT_FALSE(e.lat_deg);
  }
}

TEST(Ubx, TellsFixClassesApartByCarrierAndCorrections) {
  for (const auto& [flags, fix] : {std::pair{0x01, FixClass::single},
                                   {0x03, FixClass::dgps},
                                   {0x43, FixClass::rtk_float},
                                   {0x83, FixClass::rtk_fixed}}) {
    auto frame = k_pvt.substr(0, k_pvt.size() - 2);
    frame[27] = static_cast<char>(flags);
    EXPECT_EQ(decode(with_fletcher(frame)).at(0).fix, fix);
  }
}

TEST(Ubx, DoesNotUseAnInvalidHighPrecisionPosition) {
  auto hp = k_hp.substr(0, k_hp.size() - 2);
  hp[9] = 1;
  EXPECT_NEAR(decode(k_pvt + with_fletcher(hp)).at(0).lat_deg.value(), 51.0228123, 1e-12);
}

TEST(Ubx, HasNoTimeWhileTheReceiverDoesNotVouchForIt) {
  auto frame = k_pvt.substr(0, k_pvt.size() - 2);
  frame[17] = 0x01;  // date without time
  const auto e = decode(with_fletcher(frame)).at(0);
  EXPECT_FALSE(e.time);
  EXPECT_FALSE(to_fix(e, {}));
}

// NN 4, EE 9, DD 16, NE 1, ND 2, ED 3 in north, east, down; up is minus down.
TEST(Ubx, RotatesTheCovarianceToEastNorthUp) {
  auto cov = ubx(0x01, 0x36, 64);
  put(cov, 6, 378017800, 4);
  cov[6 + 5] = 1;
  const float values[] = {4, 1, 2, 9, 3, 16};
  for (std::size_t i = 0; i < 6; ++i) put_float(cov, 6 + 16 + 4 * i, values[i]);
  const auto e = decode(k_pvt + with_fletcher(cov) + k_hp).at(0);
  Eigen::Matrix3d expected;
  expected << 9, 1, -3, 1, 4, -2, -3, -2, 16;
  EXPECT_TRUE(e.covariance_enu_m2.value().isApprox(expected));
  EXPECT_EQ(e.sigma_e_m, 3.0);
  EXPECT_EQ(to_fix(e, {}).value().covariance_m2.value()(0, 0), 9.0);
}

// Length and units of both versions: centimetres plus tenths of millimetres.
TEST(Ubx, ReadsRelativePositionInBothVersions) {
  for (const bool v1 : {false, true}) {
    auto frame = ubx(0x01, 0x3c, v1 ? 64 : 40);
    frame[6] = v1 ? 1 : 0;
    put(frame, 6 + 4, 1000, 4);
    put(frame, 6 + 8, 9817, 4);
    put(frame, 6 + 12, -8189, 4);
    put(frame, 6 + 16, -590, 4);
    const std::size_t fine = 6 + (v1 ? 32 : 20), accuracy = 6 + (v1 ? 36 : 24), flags = 6 + (v1 ? 60 : 36);
    put(frame, fine, 45, 1);
    put(frame, fine + 1, -7, 1);
    put(frame, accuracy, 123, 4);
    put(frame, flags, 0x17, 4);  // ok, diff, valid, carrier fixed
    const auto message = ubx::parse(with_fletcher(frame)).value();
    const auto& r = std::get<ubx::RelativePosition>(message);
    EXPECT_TRUE(r.valid);
    EXPECT_EQ(r.fix, FixClass::rtk_fixed);
    EXPECT_NEAR(r.ned_m.x(), 98.1745, 1e-9);
    EXPECT_NEAR(r.ned_m.y(), -81.8907, 1e-9);
    EXPECT_NEAR(r.ned_m.z(), -5.90, 1e-9);
    EXPECT_NEAR(r.accuracy_m.x(), 0.0123, 1e-9);
  }
}

TEST(Ubx, RefusesShortPayloadsAndImpossibleDates) {
  Skips skips;
  EXPECT_TRUE(
      decode(with_fletcher(ubx(0x01, 0x07, 40)) + with_fletcher(ubx(0x01, 0x14, 8)), {}, &skips).empty());
  EXPECT_EQ(skips["ubx: payload not readable"], 2U);
  auto frame = k_pvt.substr(0, k_pvt.size() - 2);
  frame[12] = 13;  // month
  EXPECT_TRUE(decode(with_fletcher(frame)).empty());
}

TEST(UbxFraming, AFalseHeaderSwallowsNothing) {
  // Claims 8000 bytes, then a good frame begins inside them.
  const std::string false_header = from_hex("b5 62 01 07 40 1f");
  Skips skips;
  EXPECT_EQ(decode(false_header + k_pvt + k_hp, {}, &skips).size(), 1U);
  EXPECT_EQ(decode(from_hex("b5 62 01 07 ff ff") + k_pvt, {}, &skips).size(), 1U);
  EXPECT_EQ(skips["ubx: length not believable"], 1U);
}

// Found by fuzzing: a # after a frame swallowed good frames up to the next line end, where both came at once.
TEST(UbxFraming, ANumberSignBetweenFramesSwallowsNothing) {
  for (const std::optional<Protocol> only : {std::optional<Protocol>(), std::optional(Protocol::ubx)}) {
    Decoder decoder(DecoderOptions{only, {}, {}});
    Epochs epochs;
    decoder.feed(k_pvt + "#" + k_pvt + k_hp + "\n", epochs);
    EXPECT_EQ(decoder.frames(Protocol::ubx), 3U);
  }
}

// Values of the format's description; GPS time of week 378017.8 s in week 2318 is 18 leap seconds ahead.
TEST(Erb, DecodesAnEpoch) {
  const auto epochs = decode(erb_epoch());
  ASSERT_EQ(epochs.size(), 1U);
  const auto& e = epochs[0];
  EXPECT_EQ(to_rfc3339(e.time.value()), "2024-06-13T08:59:59.800000Z");
  EXPECT_NEAR(e.lat_deg.value(), 51.0228123, 1e-12);
  EXPECT_NEAR(e.lon_deg.value(), 3.7104567, 1e-12);
  EXPECT_NEAR(e.height_ellipsoid_m.value(), 67.512, 1e-12);
  EXPECT_NEAR(e.height_msl_m.value(), 22.5, 1e-12);
  EXPECT_EQ(e.fix, FixClass::rtk_fixed);
  EXPECT_EQ(e.satellites, 14);
  EXPECT_NEAR(e.hdop.value(), 0.9, 1e-12);  // the last of the four
  EXPECT_NEAR(e.age_s.value(), 0.8, 1e-12);
  EXPECT_NEAR(e.baseline_ned_m.value().x(), 98.175, 1e-12);
  EXPECT_NEAR(e.baseline_ned_m.value().z(), -5.908, 1e-12);
  EXPECT_NEAR(e.sigma_u_m.value(), std::hypot(0.014, 0.021), 1e-12);
}

TEST(Erb, QualifiesAPositionByTheStatusOfItsOwnTime) {
  // A second epoch 200 ms later without valid fix: its position must not be published with the first one's
  // status.
  auto pos = k_erb_pos.substr(0, k_erb_pos.size() - 2), stat = k_erb_stat.substr(0, k_erb_stat.size() - 2);
  put(pos, 5, 378017800 + 200, 4);
  put(stat, 5, 378017800 + 200, 4);
  stat[12] = 0;
  const auto epochs = decode(k_erb_pos + k_erb_stat + with_fletcher(pos) + with_fletcher(stat));
  ASSERT_EQ(epochs.size(), 2U);
  EXPECT_EQ(epochs[0].fix, FixClass::rtk_fixed);
  EXPECT_EQ(epochs[1].fix, FixClass::none);
  EXPECT_FALSE(epochs[1].lat_deg);
}

TEST(Erb, ReadsTheLongStatusByItsLength) {
  std::string stat = "ER\x03";
  stat += static_cast<char>(37);
  stat += '\0';
  stat += k_erb_stat.substr(5, 9) + std::string(28, '\0');
  put(stat, 5 + 10, 250, 2);
  EXPECT_NEAR(decode(k_erb_pos + with_fletcher(stat)).at(0).age_s.value(), 2.5, 1e-12);
}

TEST(ErbFraming, PlainTextThatHoldsItsLettersIsNoFrame) {
  Skips skips;
  decode("OVER AND OVER\nERROR\n", {}, &skips);
  for (const auto& [reason, entry] : skips.entries()) EXPECT_EQ(reason, "byte outside any frame");
}

TEST(GpsTime, KnowsLeapSecondsAndTenBitWeeks) {
  // 2024-06-15 23:59:50 UTC is week 2319, 8 s.
  EXPECT_EQ(
      to_rfc3339(decode("2319 8.000 51.0 3.7 62.8 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n").at(0).time.value()),
      "2024-06-15T23:59:50.000000Z");
  // The same week as a ten-bit number: 2319 - 2048.
  EXPECT_EQ(
      to_rfc3339(decode("271 8.000 51.0 3.7 62.8 1 13 0.01 0.01 0.02 0 0 0 1.1 12.5\n").at(0).time.value()),
      "2024-06-15T23:59:50.000000Z");
}

std::string dop(std::uint32_t itow_ms, int horizontal_cents) {
  auto frame = ubx(0x01, 0x04, 18);
  put(frame, 6, itow_ms, 4);
  put(frame, 6 + 12, horizontal_cents, 2);
  return with_fletcher(frame);
}

// u-blox 9 sends PVT, HPPOSLLH, then DOP. Publishing at HPPOSLLH lost the DOP and the covariance of the first
// epoch, and the DOP of every one where NAV-EOE is off.
TEST(Ubx, WaitsForWhatComesBehindTheHighPrecisionPosition) {
  const auto first = decode(k_pvt + k_hp + dop(378017800, 90)).at(0);
  EXPECT_NEAR(first.hdop.value(), 0.9, 1e-12);

  auto pvt = k_pvt.substr(0, k_pvt.size() - 2), hp = k_hp.substr(0, k_hp.size() - 2);
  put(pvt, 6, 378018000, 4), put(hp, 6 + 4, 378018000, 4);
  Decoder decoder;
  Epochs epochs;
  decoder.feed(k_pvt + k_hp + dop(378017800, 90) + with_fletcher(pvt) + with_fletcher(hp), epochs);
  EXPECT_EQ(epochs.size(), 1U);  // the second one still lacks what the first one had
  decoder.feed(dop(378018000, 80), epochs);
  ASSERT_EQ(epochs.size(), 2U);  // and is whole now, without waiting for a third
  EXPECT_NEAR(epochs[1].hdop.value(), 0.8, 1e-12);
}

// Receivers before NAV-PVT, or F9 set to HPPOSLLH alone: no fix type, so no epoch, but never in silence.
TEST(Ubx, SaysThatPositionsWithoutPvtAreNotUsed) {
  auto old = ubx(0x01, 0x02, 28), solution = ubx(0x01, 0x06, 52);
  put(old, 6, 1000, 4), put(solution, 6, 1000, 4);
  Skips skips;
  EXPECT_TRUE(decode(with_fletcher(old) + with_fletcher(solution) + k_hp, {}, &skips).empty());
  EXPECT_EQ(skips["ubx: position without NAV-PVT, which gives the fix"], 2U);
  Skips with;
  put(old, 6, 378017800, 4);
  EXPECT_EQ(decode(with_fletcher(old) + k_pvt, {}, &with).size(), 1U);
  EXPECT_TRUE(with.entries().empty());
}

// flags3 bits 4..1 of the interface description: 1 is 0..1 s, 8 is 30..45 s, 12 is 120 s and older.
TEST(Ubx, TellsTheUpperEndOfTheAgeClass) {
  for (const auto& [index, age_s] : {std::pair{0, std::optional<double>()},
                                     {1, {1.0}},
                                     {8, {45.0}},
                                     {11, {120.0}},
                                     {12, {120.0}},
                                     {13, {}}}) {
    auto frame = k_pvt.substr(0, k_pvt.size() - 2);
    put(frame, 6 + 78, index << 1, 2);
    EXPECT_EQ(decode(with_fletcher(frame)).at(0).age_s, age_s) << index;
  }
}

// The example message of RTCM 10403 (type 1005 of station 2003), with the CRC printed there.
TEST(Rtcm3Framing, CountsCorrectionsOnTheSameWireAndLosesNothing) {
  const auto rtcm = from_hex("d3 00 13 3e d7 d3 02 02 98 0e de ef 34 b4 bd 62 ac 09 41 98 6f 33 36 0b 98");
  Skips skips;
  EXPECT_EQ(decode(rtcm + k_pvt + rtcm + k_hp + rtcm, {}, &skips).size(), 1U);
  EXPECT_EQ(skips["rtcm3: corrections, no position"], 3U);
  EXPECT_EQ(skips.entries().size(), 1U);

  auto broken = rtcm;
  broken[10] ^= 1;
  Skips noise;
  EXPECT_EQ(decode(broken + k_pvt, {}, &noise).size(), 1U);
  EXPECT_EQ(noise["byte outside any frame"], rtcm.size() - 1);  // one of its bytes is a tab, a blank
  // A header that claims more than comes must not hold back what is inside.
  EXPECT_EQ(decode(from_hex("d3 03 ff") + k_pvt + k_hp).size(), 1U);
}

// Seen in a recording of a Reach without antenna: tow 0 of week 65014, at the origin of the Earth's frame.
TEST(Erb, HasNeitherTimeNorPositionBeforeTheFirstSolution) {
  auto pos = k_erb_pos.substr(0, k_erb_pos.size() - 2), stat = k_erb_stat.substr(0, k_erb_stat.size() - 2);
  put(pos, 5, 0, 4), put(stat, 5, 0, 4);
  const double origin[] = {0, -90, -6378137, -6378107.465999603};
  std::memcpy(&pos[9], origin, sizeof origin);
  put(stat, 9, 65014, 2);
  stat[11] = stat[12] = stat[13] = 0;
  Skips skips;
  const auto epochs = decode(with_fletcher(pos) + with_fletcher(stat), {}, &skips);
  ASSERT_EQ(epochs.size(), 1U);
  EXPECT_FALSE(epochs[0].time || epochs[0].lat_deg);
  EXPECT_EQ(epochs[0].fix, FixClass::none);
  EXPECT_TRUE(skips.entries().empty());
}

}  // namespace
}  // namespace anchord::gnss::binary_test
