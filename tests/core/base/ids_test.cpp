#include "core/base/ids.hpp"

#include <gtest/gtest.h>

namespace anchord::ids_test {
namespace {

TEST(Uuid, Version7SortsByTimeAndSurvivesTheRoundTrip) {
  const Uuid a = make_uuid_v7(UtcTime::from_us(1777889472345678));
  const Uuid b = make_uuid_v7(UtcTime::from_us(1777889472346678));
  EXPECT_LT(a, b);
  const std::string text = to_string(a);
  EXPECT_EQ(text[14], '7');                        // RFC 9562 section 5.7: version nibble
  EXPECT_EQ(text.substr(0, 13), "019df278-6f59");  // 1777889472345 ms in hexadecimal
  EXPECT_EQ(parse_uuid(text).value(), a);
}

// RFC 9562 section 6.2: what a program makes within one tick of its clock still sorts as it was made.
TEST(Uuid, Version7OfOneMillisecondSortsAsItWasMade) {
  const UtcTime now = UtcTime::from_us(1777889472345678);
  Uuid before = make_uuid_v7(now);
  for (int i = 0; i < 20'000; ++i) {
    const Uuid next = make_uuid_v7(now);
    ASSERT_LT(before, next) << i;
    ASSERT_EQ(to_string(next).substr(0, 15), "019df278-6f59-7") << "its time and its version are untouched";
    ASSERT_EQ(next.bytes[8] >> 6, 2) << "the variant of RFC 9562";
    before = next;
  }
}

TEST(Uuid, Version7OfTwoMillisecondsShareNothingOfTheirRandomBits) {
  const auto tail = [](std::int64_t us) { return to_string(make_uuid_v7(UtcTime::from_us(us))).substr(15); };
  EXPECT_NE(tail(1'000), tail(2'000));
  EXPECT_NE(tail(1'000), tail(2'000)) << "nor a clock set back the bits it gave before";
}

TEST(Uuid, RefusesAnythingButTheCanonicalForm) {
  for (const char* text :
       {"", "0197a3c2", "0197a3c25d107b1e9c550a1b2c3d4e5f", "0197a3c2-5d10-7b1e-9c55-0a1b2c3d4e5g"}) {
    EXPECT_FALSE(parse_uuid(text)) << text;
  }
}

TEST(NetworkId, ReadsHexAndDecimalAndWritesFourHexDigits) {
  EXPECT_EQ(to_string(parse_network_id("0x6A2F").value()), "0x6a2f");
  EXPECT_EQ(to_string(parse_network_id("101").value()), "0x0065");
  for (const char* text : {"", "0x", "6a2f", "-1", "0x1ffffffff", "1 "})
    EXPECT_FALSE(parse_network_id(text)) << text;
}

}  // namespace
}  // namespace anchord::ids_test
