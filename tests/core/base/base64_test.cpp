#include "core/base/base64.hpp"

#include <gtest/gtest.h>

#include <string>
#include <string_view>
#include <utility>

namespace anchord::base64_test {
namespace {

// RFC 4648 section 10.
constexpr std::pair<const char*, const char*> k_vectors[] = {{"", ""},
                                                             {"f", "Zg=="},
                                                             {"fo", "Zm8="},
                                                             {"foo", "Zm9v"},
                                                             {"foob", "Zm9vYg=="},
                                                             {"fooba", "Zm9vYmE="},
                                                             {"foobar", "Zm9vYmFy"},
                                                             {"\xfb\xef\xff", "++//"}};

}  // namespace

TEST(Base64, MatchesThePublishedVectorsBothWays) {
  for (const auto& [plain, coded] : k_vectors) {
    EXPECT_EQ(base64(plain), coded);
    EXPECT_EQ(from_base64(coded), plain);
  }
}

TEST(Base64, RefusesWhatOpensslOverlooks) {
  for (const char* text : {"Zg", "Zg=", "Z===", "====", "=", "Zg==Zg==", "Z=g=", " Zg==", "Zg==\n",
                           "Zm9v\n\n\n\n", "Zm-_", "Zm9\xc3"})
    EXPECT_EQ(from_base64(text), std::nullopt) << text;
}

TEST(Base64, PassesTheBlocksThatOpensslIsGivenAtOnce) {
  for (const std::size_t size : {(3U << 20) - 1, 3U << 20, (3U << 20) + 1, (6U << 20) + 2}) {
    std::string bytes(size, '\0');
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(i * 2654435761U >> 24U);
    const auto coded = base64(bytes);
    EXPECT_EQ(coded.size(), (size + 2) / 3 * 4);
    EXPECT_EQ(from_base64(coded), bytes) << size;
  }
}

// OpenSSL codes what is decoded here, at every length round the pieces that are taken at once.
TEST(Base64, DecodesEveryLengthAsOpensslCodedIt) {
  for (std::size_t size = 0; size < 260; ++size) {
    std::string bytes(size, '\0');
    for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>((i + size) * 2654435761U >> 24U);
    EXPECT_EQ(from_base64(base64(bytes)), bytes) << size;
  }
}

TEST(Base64, KnowsADigitFromAnyOtherByteAtEveryPlace) {
  constexpr std::string_view alphabet = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  const std::string digits(120, 'A');
  for (std::size_t place = 0; place < digits.size(); ++place) {
    for (int byte = 0; byte < 256; ++byte) {
      std::string text = digits;
      text[place] = static_cast<char>(byte);
      const auto value = alphabet.find(static_cast<char>(byte));
      if (byte == '=' && place + 1 == digits.size()) continue;  // padding
      const auto bytes = from_base64(text);
      ASSERT_EQ(bytes.has_value(), value != std::string_view::npos) << place << ' ' << byte;
      if (!bytes) continue;
      const std::size_t group = place / 4 * 3;
      const unsigned bits = static_cast<unsigned char>((*bytes)[group]) << 16U |
                            static_cast<unsigned char>((*bytes)[group + 1]) << 8U |
                            static_cast<unsigned char>((*bytes)[group + 2]);
      ASSERT_EQ(bits, static_cast<unsigned>(value) << (6 * (3 - place % 4))) << place << ' ' << byte;
    }
  }
}

}  // namespace anchord::base64_test
