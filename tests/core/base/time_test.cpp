#include "core/base/time.hpp"

#include <gtest/gtest.h>

namespace anchord::time_test {
namespace {

// 1777889472 is what `date -u -d 2026-05-04T10:11:12Z +%s` prints.
TEST(Rfc3339, ReadsAndWritesMicroseconds) {
  const auto t = parse_rfc3339("2026-05-04T10:11:12.345678Z");
  ASSERT_TRUE(t);
  EXPECT_EQ(t.value().ns, 1777889472345678000);
  EXPECT_EQ(to_rfc3339(t.value()), "2026-05-04T10:11:12.345678Z");
}

TEST(Rfc3339, RefusesWhatIsNotUtcOrNotADate) {
  for (const char* text :
       {"", "2026-05-04", "2026-05-04T10:11:12", "2026-05-04T10:11:12+02:00", "2026-02-30T10:11:12Z",
        "2026-05-04T25:11:12Z", "2026-05-04T10:11:12.Z", "2026-05-04T10:11:1xZ"}) {
    EXPECT_FALSE(parse_rfc3339(text)) << text;
  }
}

// A fuzzer found that years outside the 64 bits of nanoseconds overflowed and read as some other century.
TEST(Rfc3339, RefusesYearsThatNanosecondsCannotHold) {
  for (const char* text :
       {"0026-05-04T10:11:12Z", "1677-12-31T23:59:59Z", "2262-01-01T00:00:00Z", "9999-12-31T23:59:59Z"}) {
    EXPECT_FALSE(parse_rfc3339(text)) << text;
  }
  EXPECT_TRUE(parse_rfc3339("1678-01-01T00:00:00Z"));
  EXPECT_EQ(to_rfc3339(parse_rfc3339("2261-12-31T23:59:59.999999Z").value()), "2261-12-31T23:59:59.999999Z");
}

TEST(Rfc3339, WritesInstantsBeforeTheEpoch) {
  EXPECT_EQ(to_rfc3339({-1'000'000}), "1969-12-31T23:59:59.999000Z");
}

}  // namespace
}  // namespace anchord::time_test
