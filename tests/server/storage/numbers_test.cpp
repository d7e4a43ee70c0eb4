// Enums that the database keeps as numbers: written once, read by every later version. The numbers are those
// of the comments and checks of migrations/sqlite.
#include <gtest/gtest.h>

#include <map>
#include <string>

#include "core/ports/job_store.hpp"
#include "core/ports/measurement_store.hpp"
#include "core/types/estimate.hpp"
#include "core/types/exclusion.hpp"
#include "core/types/fix.hpp"
#include "core/types/mission.hpp"
#include "core/types/range.hpp"

namespace anchord::numbers_test {
namespace {

template <class T, std::size_t N>
void expect_numbers(const EnumTable<T, N>& table, const std::map<std::string, std::int64_t>& kept) {
  ASSERT_EQ(table.size(), kept.size());
  for (const auto& [word, number] : kept) {
    const auto value = table.of_number(number);
    ASSERT_TRUE(value) << word;
    EXPECT_EQ(table.word(*value), word) << number;
  }
  EXPECT_FALSE(table.of_number(static_cast<std::int64_t>(kept.size())));
  EXPECT_FALSE(table.of_number(-1));
}

TEST(StoredNumbers, StandForTheSameWordsInEveryVersion) {
  expect_numbers(k_frame_words, {{"wgs84", 0}, {"local", 1}});
  expect_numbers(k_point_words, {{"gnss_antenna", 0}, {"body", 1}, {"tag_antenna", 2}});
  expect_numbers(k_mission_state_words, {{"planned", 0}, {"recording", 1}, {"finished", 2}});
  expect_numbers(k_range_kind_words, {{"tag_anchor", 0}, {"anchor_anchor", 1}});
  expect_numbers(k_fix_words, {{"none", 0}, {"single", 1}, {"dgps", 2}, {"float", 3}, {"fixed", 4}});
  expect_numbers(k_radio_words, {{"tag", 0}, {"anchor", 1}});
  expect_numbers(k_verdict_words,
                 {{"ok", 0}, {"weak_geometry", 1}, {"ambiguous", 2}, {"too_few", 3}, {"diverged", 4}});
  expect_numbers(k_job_state_words,
                 {{"queued", 0}, {"running", 1}, {"succeeded", 2}, {"failed", 3}, {"canceled", 4}});
  expect_numbers(k_row_kind_words, {{"ranges", 0}, {"fixes", 1}});
}

}  // namespace
}  // namespace anchord::numbers_test
