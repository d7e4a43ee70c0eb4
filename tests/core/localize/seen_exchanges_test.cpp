#include "core/localize/seen_exchanges.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <random>
#include <tuple>

namespace anchord::seen_exchanges_test {
namespace {

Range exchange(std::int64_t ns, std::uint32_t tag, std::uint8_t antenna, std::uint32_t anchor) {
  Range range;
  range.time = UtcTime{ns};
  range.tag = NetworkId{tag};
  range.antenna = antenna;
  range.anchor = NetworkId{anchor};
  return range;
}

TEST(SeenExchanges, DifferInTimeTagAntennaAndAnchor) {
  SeenExchanges seen(10);
  EXPECT_TRUE(seen.insert(exchange(5, 1, 0, 2)));
  EXPECT_FALSE(seen.insert(exchange(5, 1, 0, 2)));
  EXPECT_TRUE(seen.insert(exchange(6, 1, 0, 2)));
  EXPECT_TRUE(seen.insert(exchange(5, 2, 0, 2)));
  EXPECT_TRUE(seen.insert(exchange(5, 1, 1, 2)));
  EXPECT_TRUE(seen.insert(exchange(5, 1, 0, 3)));
}

// A list that is searched from end to end, of few exchanges so that most come again.
TEST(SeenExchanges, RememberTheNewestAndForgetTheFirst) {
  std::mt19937_64 random(7);
  std::uniform_int_distribution<int> one(0, 5);
  SeenExchanges seen(100);
  std::deque<std::tuple<int, int, int, int>> list;
  int n_new = 0;
  for (int i = 0; i < 20'000; ++i) {
    const std::tuple next{one(random), one(random), one(random) % 2, one(random)};
    const bool known = std::ranges::find(list, next) != list.end();
    const auto& [ns, tag, antenna, anchor] = next;
    ASSERT_EQ(seen.insert(exchange(ns, static_cast<std::uint32_t>(tag), static_cast<std::uint8_t>(antenna),
                                   static_cast<std::uint32_t>(anchor))),
              !known)
        << i;
    if (known) continue;
    ++n_new;
    list.push_back(next);
    if (list.size() > 100) list.pop_front();
  }
  EXPECT_GT(n_new, 1000);
  EXPECT_EQ(seen.size(), 100u);
}

// Of a clock that counts 100 us, as an upload has them: each once, then the newest again, then one too old.
TEST(SeenExchanges, RememberAsManyAsTheyMayOfALongUpload) {
  constexpr std::int64_t most = 80'000, all = 200'000;
  SeenExchanges seen(most);
  const auto at = [](std::int64_t i) {
    return exchange(1'777'889'472'000'000'000 + i * 100'000, 0x6e01, 0,
                    0x6a20 + static_cast<std::uint32_t>(i % 6));
  };
  for (std::int64_t i = 0; i < all; ++i) ASSERT_TRUE(seen.insert(at(i))) << i;
  for (std::int64_t i = all - most; i < all; ++i) ASSERT_FALSE(seen.insert(at(i))) << i;
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(most));
  EXPECT_TRUE(seen.insert(at(all - most - 1)));
  EXPECT_TRUE(seen.insert(at(all - most))) << "the oldest made room for the one before";
  EXPECT_FALSE(seen.insert(at(all - 1)));
}

}  // namespace
}  // namespace anchord::seen_exchanges_test
