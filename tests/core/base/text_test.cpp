#include "core/base/text.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "core/base/line_text.hpp"
#include "core/base/to_wire.hpp"

namespace anchord::text_test {
namespace {

const std::string k_fffd = "\xef\xbf\xbd";

std::string replaced(int n, const std::string& rest = {}) {
  std::string out;
  while (n-- > 0) out += k_fffd;
  return out + rest;
}

// Tables 3-8 to 3-11 of the Unicode standard, chapter 3.9.
TEST(ToUtf8, ReplacesEachMaximalSubpartOnce) {
  EXPECT_EQ(to_utf8("\xc0\xaf\xe0\x80\xbf\xf0\x81\x82\x41"), replaced(8, "A"));
  EXPECT_EQ(to_utf8("\xed\xa0\x80\xed\xbf\xbf\xed\xaf\x41"), replaced(8, "A"));
  EXPECT_EQ(to_utf8("\xf4\x91\x92\x93\xff\x41\x80\xbf\x42"), replaced(5, "A") + replaced(2, "B"));
  EXPECT_EQ(to_utf8("\xe1\x80\xe2\xf0\x91\x92\xf1\xbf\x41"), replaced(4, "A"));
}

TEST(ToUtf8, LeavesWellFormedTextAsItIs) {
  for (const std::string text : {"", "ICY 401",
                                 "Br\xc3\xbc"
                                 "cke",
                                 "\xe2\x82\xac", "\xf0\x9f\x9a\x81", "\xf4\x8f\xbf\xbf"}) {
    EXPECT_TRUE(is_utf8(text)) << text;
    EXPECT_EQ(to_utf8(text), text);
  }
}

TEST(ToUtf8, CutsBetweenCharactersAndNeverInsideOne) {
  const std::string text = "a\xc3\xbc\xe2\x82\xac\xf0\x9f\x9a\x81";  // 1 + 2 + 3 + 4 bytes
  const std::size_t borders[] = {0, 1, 1, 3, 3, 3, 6, 6, 6, 6, 10, 10};
  for (std::size_t n = 0; n < std::size(borders); ++n) {
    EXPECT_EQ(to_utf8(text, n), text.substr(0, borders[n])) << n;
    EXPECT_TRUE(is_utf8(to_utf8("\xff" + text + "\xff", n))) << n;
    EXPECT_LE(to_utf8("\xff" + text + "\xff", n).size(), n);
  }
}

TEST(ToUtf8, MakesUtf8OfEveryPairOfBytesAndOfEveryCutCharacter) {
  for (int a = 0; a < 256; ++a) {
    for (int b = 0; b < 256; ++b) {
      const std::string bytes{static_cast<char>(a), static_cast<char>(b)};
      const auto text = to_utf8(bytes);
      ASSERT_TRUE(is_utf8(text)) << a << ' ' << b;
      ASSERT_EQ(is_utf8(bytes), text == bytes) << a << ' ' << b;
    }
  }
  const std::string whole = "\xf0\x9f\x9a\x81";
  for (std::size_t n = 1; n < whole.size(); ++n) EXPECT_EQ(to_utf8(whole.substr(0, n)), k_fffd);
}

TEST(Printable, ShowsWhatWouldMoveATerminal) {
  EXPECT_EQ(printable("a\x1b[2Jb\r\n\x7f\xc2\x9b"
                      "c\xff"),
            "a\\x1b[2Jb\\x0d\n\\x7f\\x9bc" + k_fffd);
  EXPECT_EQ(printable("Br\xc3\xbc"
                      "cke \xc2\xa0"),
            "Br\xc3\xbc"
            "cke \xc2\xa0");
}

TEST(Printable, ShowsWhatTurnsTheDirectionOfWriting) {
  for (const char last : {'\xaa', '\xab', '\xac', '\xad', '\xae'}) {
    const std::string one = std::string("\xe2\x80") + last;
    EXPECT_EQ(printable("a" + one + "b").find(one), std::string::npos);
    EXPECT_EQ(json_text(one).find(one), std::string::npos);
  }
  for (const char last : {'\xa6', '\xa7', '\xa8', '\xa9'}) {
    const std::string one = std::string("\xe2\x81") + last;
    EXPECT_EQ(printable("a" + one + "b").find(one), std::string::npos);
    EXPECT_EQ(json_text(one).find(one), std::string::npos);
  }
  EXPECT_EQ(printable("gnp\xe2\x80\xaexe"), "gnp\\u202exe");
  EXPECT_EQ(json_text("\xe2\x81\xa6x"), R"("\u2066x")");
  // Punctuation of the same block, and letters that are read from the right.
  const std::string plain = "\xe2\x80\xa9\xe2\x80\xaf\xe2\x81\xa5 \xd9\x82\xd8\xa7\xd8\xb9\xd8\xa9";
  EXPECT_EQ(printable(plain), plain);
}

TEST(LineFault, CountsCharactersAndFindsControls) {
  std::string emoji, cjk;
  for (int i = 0; i < 200; ++i) {
    emoji += "\xf0\x9f\x9b\xb0";
    cjk += "\xe6\x97\xa5";
  }
  EXPECT_EQ(characters_of(emoji), 200U);
  for (const auto& text : {emoji, cjk, std::string(200, 'a'), std::string()})
    EXPECT_EQ(line_fault(text, 200), LineFault::none);
  for (const auto& text : {emoji + "a", cjk + "a", std::string(201, 'a')})
    EXPECT_EQ(line_fault(text, 200), LineFault::too_long);
  EXPECT_EQ(line_fault(std::string(801, '\x80'), 200), LineFault::too_long) << "no more bytes than four each";
  for (const char c : {'\0', '\t', '\n', '\r', '\x1b', '\x7f'})
    EXPECT_EQ(line_fault(std::string("a") + c, 200), LineFault::control_character);
}

TEST(JsonText, IsOneJsonStringOnOneLineForEveryPairOfBytes) {
  for (int a = 0; a < 256; ++a) {
    for (int b = 0; b < 256; ++b) {
      const std::string bytes{'x', static_cast<char>(a), static_cast<char>(b)};
      const auto text = json_text(bytes);
      const auto read = nlohmann::json::parse(text, nullptr, false);
      ASSERT_TRUE(read.is_string()) << a << ' ' << b;
      ASSERT_EQ(read.get<std::string>(), to_utf8(bytes));
      for (const char c : text)
        ASSERT_TRUE(static_cast<unsigned char>(c) >= 0x20 && c != 0x7f) << a << ' ' << b;
    }
  }
  EXPECT_EQ(json_text("\xc2\x9b"
                      "2J"),
            R"("\u009b2J")");  // CSI of an eight-bit terminal
  EXPECT_EQ(json_text("say \"a\\b\"\n"), R"("say \"a\\b\"\n")");
}

TEST(ToWire, ThrowsOnNoBytesAndWritesNoNumberThatIsNone) {
  const nlohmann::ordered_json json{{"reason",
                                     "ICY 4\xff\xfe"
                                     "1 Nicht erlaubt"},
                                    {"key \xf0\x9f", std::nan("")},
                                    {"far", std::numeric_limits<double>::infinity()}};
  const auto text = to_wire(json);
  EXPECT_EQ(text, "{\"reason\":\"ICY 4" + replaced(2) + "1 Nicht erlaubt\",\"key " + k_fffd +
                      "\":null,\"far\":null}");
  EXPECT_TRUE(nlohmann::json::parse(to_wire(json, 2), nullptr, false).is_object());
}

}  // namespace
}  // namespace anchord::text_test
