#include "drivers/dwm1001/protocol.hpp"

#include <gtest/gtest.h>

#include <random>

#include "core/base/ids.hpp"

namespace anchord::dwm1001::protocol_test {
namespace {

using namespace std::string_literals;

/// Recorded of a module, as published with programs that read it (R2 firmware, four anchors).
const std::string k_les =
    "022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00,0.00]=5.49 DCAE[0.00,8.03,0.00]=7.73 5431[0.00,0.00,0.00]=9.01 "
    "le_us=3082 est[6.97,5.17,-1.77,53]";

std::string read(std::string_view line) {
  const auto found = parse_les(line);
  if (!found) return "bad";
  if (!found.value()) return "none";
  std::string out;
  for (const auto& one : *found.value())
    out += to_string(NetworkId{one.anchor}) + '=' + std::to_string(one.distance_m).substr(0, 4) + ' ';
  return out;
}

TEST(DwmShell, HasTheDistancesOfARecordedLine) {
  const std::string all = "0x022e=3.38 0x9280=5.49 0xdcae=7.73 0x5431=9.01 ";
  EXPECT_EQ(read(k_les), all);
  EXPECT_EQ(read("dwm> " + k_les), all) << "behind the prompt";
  EXPECT_EQ(read("022E[7.94,8.03,0.00]=3.38 "), "0x022e=3.38 ") << "without a location engine";
  EXPECT_EQ(read("022E[-7.94,8.03,-0.20]=123.38"), "0x022e=123. ");
  for (const char* other :
       {"", "dwm> ", "les", "le_us=3082 est[6.97,5.17,-1.77,53]", "POS,7.10,5.24,-2.03,53",
        "[000003.780 INF] uwb0: panid=xABCD addr=xDECA1F2E3D4C022E"})
    EXPECT_EQ(read(other), "none") << other;
}

TEST(DwmShell, RejectsLinesThatRanIntoEachOther) {
  for (const char* line :
       {"022E[7.94,8.03,0.00]=3.022E[7.94,8.03,0.00]=3.38", "022E[7.94,8.03,0.00]=3.3",
        "022E[7.94,8.03,0.00]=3.388", "022E[7.94,8.03]=3.38", "22E[7.94,8.03,0.00]=3.38",
        "022G[7.94,8.03,0.00]=3.38", "022E[7.94,8.03,0.00]=-3.38", "022E[7.94,8.03,0.00]=3.38 9280[7.95,0.00",
        "022E[7.94,8.03,0.00]=3.38 022E[7.94,8.03,0.00]=3.40", "022E[7.94,8.03,0.00]=3.38 le_us=30022E",
        "022E[7.94,8.03,0.00]=nan", "022E[7.94,8.03,0.00]=1e9", "022E[,,]=3.38", "022E]=3.38[", "]=3.38"})
    EXPECT_EQ(read(line), "bad") << line;
}

TEST(DwmShell, IsReadOrRejectedButNeverWrongWhereItIsCut) {
  const std::string all = read(k_les);
  for (std::size_t n = 0; n < k_les.size(); ++n) {
    const auto got = read(std::string_view(k_les).substr(0, n));
    EXPECT_TRUE(got == "bad" || got == "none" || all.starts_with(got)) << n << ' ' << got;
  }
}

TEST(DwmShell, HasPositionAndId) {
  const auto at = parse_lep("POS,7.10,5.24,-2.03,53");
  ASSERT_TRUE(at);
  EXPECT_DOUBLE_EQ(at->x_m, 7.10);
  EXPECT_DOUBLE_EQ(at->z_m, -2.03);
  EXPECT_EQ(at->quality, 53);
  for (const char* bad : {"POS,7.10,5.24,-2.03", "POS,7.10,5.24,-2.03,101", "POS,7.1,5.24,-2.03,53",
                          "POS,,,,", "7.10,5.24,-2.03,53"})
    EXPECT_FALSE(parse_lep(bad)) << bad;
  EXPECT_EQ(node_id_in("[000003.780 INF] uwb0: panid=xABCD addr=xDECA1F2E3D4C022E"), 0xDECA1F2E3D4C022Eu);
  for (const char* bad : {"", "addr=x", "addr=xzz", "addr=x12", "panid=xABCD"})
    EXPECT_FALSE(node_id_in(bad)) << bad;
}

// By the field list of the firmware's API guide, 5.3.10: two anchors.
const std::string k_answer =
    "\x40\x01\x00"
    "\x41\x0d\x3a\x1b\0\0\x32\x14\0\0\x16\xf9\xff\xff\x35"
    "\x49\x29\x02"
    "\x2e\x02\x34\x0d\0\0\x64\x04\x1f\0\0\x5e\x1f\0\0\0\0\0\0\x64"
    "\x80\x92\x72\x15\0\0\x50\x0e\x1f\0\0\0\0\0\0\0\0\0\0\x64"s;

TEST(DwmBinary, HasPositionAndDistancesAndIsWaitedForUntilItIsWhole) {
  for (std::size_t n = 0; n < k_answer.size(); ++n) {
    const auto part = parse_location(std::string_view(k_answer).substr(0, n));
    ASSERT_TRUE(part) << n;
    EXPECT_FALSE(part.value()) << n;
  }
  const auto whole = parse_location(k_answer + "more");
  ASSERT_TRUE(whole && whole.value());
  const Location& found = *whole.value();
  EXPECT_EQ(found.bytes, k_answer.size());
  ASSERT_TRUE(found.estimate);
  EXPECT_DOUBLE_EQ(found.estimate->x_m, 6.970);
  EXPECT_DOUBLE_EQ(found.estimate->z_m, -1.770);
  EXPECT_EQ(found.estimate->quality, 53);
  ASSERT_EQ(found.distances.size(), 2u);
  EXPECT_EQ(found.distances[0].anchor, 0x022e);
  EXPECT_DOUBLE_EQ(found.distances[0].distance_m, 3.380);
  EXPECT_EQ(found.distances[0].quality, 100);
  EXPECT_EQ(found.distances[1].anchor, 0x9280);
  EXPECT_DOUBLE_EQ(found.distances[1].distance_m, 5.490);
}

TEST(DwmBinary, IsRefusedAnAnchorOrNoAnswerAtAll) {
  EXPECT_EQ(parse_location("\x40\x01\x04"s).value()->error, 4);
  EXPECT_TRUE(
      parse_location("\x40\x01\0\x41\x0d"s + std::string(13, '\0') + "\x48\x01\0"s).value()->is_anchor);
  for (const auto& bad : {"dwm> "s, "\x40\x02"s, "\x40\x01\0\x77\0"s, "\x40\x01\0\x41\x0c"s,
                          "\x40\x01\0\x49\x02\x01x"s, "\x40\x01\0\x49\0"s, "\x40\x01\0\x49\x01\x05"s})
    EXPECT_FALSE(parse_location(bad)) << bad;
  std::mt19937_64 random(3);
  for (int i = 0; i < 20'000; ++i) {
    std::string bytes = k_answer.substr(0, random() % (k_answer.size() + 1));
    for (int k = 0; k < 3 && !bytes.empty(); ++k)
      bytes[random() % bytes.size()] = static_cast<char>(random());
    (void)parse_location(bytes).has_value();
    (void)parse_les(bytes).has_value();
  }
}

}  // namespace
}  // namespace anchord::dwm1001::protocol_test
