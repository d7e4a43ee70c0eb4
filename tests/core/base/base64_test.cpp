#include "core/base/base64.hpp"

#include <gtest/gtest.h>

#include <utility>

namespace anchord {
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

}  // namespace anchord
