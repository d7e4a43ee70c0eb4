#include "drivers/record/event.hpp"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace anchord::record::event_test {
namespace {

TEST(Crc32c, HasThePublishedValues) {
  // RFC 3720 B.4, and the check value of the CRC catalogue.
  EXPECT_EQ(crc32c("123456789"), 0xE306'9283U);
  EXPECT_EQ(crc32c(std::string(32, '\0')), 0x8A91'36AAU);
  EXPECT_EQ(crc32c(std::string(32, '\xff')), 0x62A8'AB43U);
}

std::string sample(std::vector<std::size_t>& ends) {
  std::string file(k_magic);
  for (int i = 0; i < 5; ++i) {
    append_record(file, {static_cast<EventKind>(3 + i % 3),
                         static_cast<std::uint16_t>(i),
                         {UtcTime{1'700'000'000'000'000'000 + i}, 1000 + i},
                         std::string(static_cast<std::size_t>(7 * i), 'x')});
    ends.push_back(file.size());
  }
  return file;
}

std::size_t readable(std::string_view file) {
  EventReader reader(file);
  if (!reader.begin()) return 0;
  std::size_t n = 0;
  while (reader.next()) ++n;
  return n;
}

TEST(Recording, GivesBackWhatWasWritten) {
  std::vector<std::size_t> ends;
  const auto file = sample(ends);
  EventReader reader(file);
  ASSERT_TRUE(reader.begin());
  for (int i = 0; i < 5; ++i) {
    const auto event = reader.next();
    ASSERT_TRUE(event);
    EXPECT_EQ(event->slot, i);
    EXPECT_EQ(event->at.steady_ns, 1000 + i);
    EXPECT_EQ(event->at.utc.ns, 1'700'000'000'000'000'000 + i);
    EXPECT_EQ(event->payload, std::string(static_cast<std::size_t>(7 * i), 'x'));
  }
  EXPECT_FALSE(reader.next());
  EXPECT_EQ(reader.left(), 0U);
}

TEST(Recording, TornAtAnyByteKeepsEveryRecordBeforeTheTear) {
  std::vector<std::size_t> ends;
  const auto file = sample(ends);
  for (std::size_t n = 0; n <= file.size(); ++n) {
    std::size_t whole = 0;
    for (const auto end : ends) whole += end <= n;
    EXPECT_EQ(readable(std::string_view(file).substr(0, n)), whole) << n;
  }
}

TEST(Recording, AChangedByteEndsItThereAndIsNeverBelieved) {
  std::vector<std::size_t> ends;
  const auto file = sample(ends);
  for (std::size_t n = k_magic.size(); n < file.size(); ++n) {
    auto bad = file;
    bad[n] = static_cast<char>(bad[n] ^ 0x10);
    std::size_t before = 0;
    for (const auto end : ends) before += end <= n;
    EXPECT_EQ(readable(bad), before) << n;
  }
}

}  // namespace
}  // namespace anchord::record::event_test
