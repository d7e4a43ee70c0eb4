#include "core/base/enum_table.hpp"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "core/base/errc_words.hpp"

namespace anchord::enum_table_test {
namespace {

// Not in the order of the words, so that nothing is right by its position alone.
enum class Colour : std::uint8_t { red, green, blue };
constexpr auto k_colours =
    enum_table<Colour>({{"blue", Colour::blue}, {"red", Colour::red}, {"green", Colour::green}});
constexpr auto k_modes = enum_table<bool>({{"auto", false}, {"manual", true}});

TEST(EnumTable, HasOneWordForEachValueAndBack) {
  EXPECT_EQ(k_colours.word(Colour::red), "red");
  EXPECT_EQ(k_colours.word(Colour::blue), "blue");
  EXPECT_EQ(k_colours.find("green"), Colour::green);
  EXPECT_EQ(k_modes.find("manual"), true);
  EXPECT_EQ(k_modes.word(false), "auto");
  const auto words = k_colours.words();
  EXPECT_EQ(std::vector<std::string_view>(words.begin(), words.end()),
            (std::vector<std::string_view>{"blue", "red", "green"}));
}

TEST(EnumTable, FindsNothingForAnotherWord) {
  for (const char* other : {"", "Red", "red ", "redd", "0", "1"})
    EXPECT_EQ(k_colours.find(other), std::nullopt) << other;
}

TEST(EnumTable, ListsTheWordsThatMayBeUsedInItsError) {
  const auto parsed = k_colours.parse("colour", "pink");
  ASSERT_FALSE(parsed);
  EXPECT_EQ(parsed.error().code, Errc::invalid_argument);
  EXPECT_EQ(parsed.error().message, "unknown colour \"pink\": must be one of blue, red, green");
  EXPECT_EQ(k_colours.parse("colour", "red").value(), Colour::red);
}

TEST(EnumTable, ShowsNoMoreThanTheBeginningOfAWordFromOutside) {
  const auto message = k_colours.parse("colour", std::string(1000, 'x') + "\xff").error().message;
  EXPECT_LT(message.size(), 150u);
}

TEST(EnumTable, GivesAValueByItsNumberAndNothingForAnother) {
  EXPECT_EQ(k_colours.of_number(0), Colour::red);
  EXPECT_EQ(k_colours.of_number(2), Colour::blue);
  EXPECT_EQ(k_colours.of_number(3), std::nullopt);
  EXPECT_EQ(k_colours.of_number(-1), std::nullopt);
  EXPECT_EQ(k_colours.of_number(256), std::nullopt);  // 0 as a byte
}

TEST(EnumTable, ThrowsForANumberThatWasCast) {
  EXPECT_THROW((void)k_colours.word(static_cast<Colour>(3)), std::logic_error);
}

TEST(EnumTable, SeesAnEnumeratorThatHasNoWord) {
  EXPECT_TRUE(detail::is_enumerator<Colour::blue>());
  EXPECT_TRUE(detail::is_enumerator<static_cast<Colour>(1)>());
  EXPECT_FALSE(detail::is_enumerator<static_cast<Colour>(3)>());  // else it would have to be in the table
}

TEST(ErrcWords, NameEachCodeByItself) {
  EXPECT_EQ(k_errc_words.word(Errc::too_few_observations), "too_few_observations");
  EXPECT_EQ(k_errc_words.find("canceled"), Errc::canceled);
  EXPECT_EQ(k_errc_words.size(), 15u);
}

}  // namespace
}  // namespace anchord::enum_table_test
