#include "server/runtime/token_file.hpp"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/scratch_dir.hpp"

namespace anchord::server::token_file_test {
namespace {

Result<std::string> read(const std::string& text) {
  const ScratchDir folder;
  const auto file = folder.path() / "a token";
  std::ofstream(file, std::ios::binary) << text;
  return token_in(file);
}

TEST(TokenFile, HasATokenAsItIsOrAsItWasMade) {
  EXPECT_EQ(read("anc_abc").value(), "anc_abc");
  EXPECT_EQ(read(" \r\nanc_abc \r\nof the north crew\n").value(), "anc_abc");
  EXPECT_EQ(read(R"({"id":"01a2","token":"anc_abc","roles":["viewer"]})"
                 "\n")
                .value(),
            "anc_abc");
}

TEST(TokenFile, WithoutOneIsNamed) {
  for (const char* text : {"", " \n", "{", R"({"id":"01a2"})", R"({"token":""})", R"({"token":7})", "{}"}) {
    const auto token = read(text);
    ASSERT_FALSE(token) << text;
    EXPECT_EQ(token.error().code, Errc::invalid_argument);
    EXPECT_NE(token.error().message.find("a token: no access token in this file"), std::string::npos) << text;
  }
  EXPECT_FALSE(token_in("/nowhere/at all"));
}

}  // namespace
}  // namespace anchord::server::token_file_test
