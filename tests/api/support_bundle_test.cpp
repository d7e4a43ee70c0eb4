// What is sent to whoever helps opens no door, and every tar reads it.
#include "api/admin/support_bundle.hpp"

#include <gtest/gtest.h>

namespace anchord::api::support_bundle_test {
namespace {

TEST(WithoutSecrets, LeavesOutWhatOpensDoorsAndKeepsTheRest) {
  const std::string key(64, 'a');
  const std::string text = without_secrets(
      "listen = \"127.0.0.1:8420\"\n"
      "devices = \"ntrip=ntrip://user:pa55@caster.example:2101/MOUNT\"\n"
      R"({"msg":"login","header":"Authorization: Bearer abc.def-123","password":"hunter2","n":7})"
      "\n"
      R"({"apiToken" : "t0k","text":"key )" +
      key + R"( seen"})" + "\n");
  for (const char* secret : {"pa55", "user:", "abc.def-123", "hunter2", "t0k", key.c_str()})
    EXPECT_EQ(text.find(secret), std::string::npos) << secret << " in " << text;
  for (const char* kept :
       {"127.0.0.1:8420", "caster.example:2101/MOUNT", "\"msg\":\"login\"", "\"n\":7", "seen"})
    EXPECT_NE(text.find(kept), std::string::npos) << kept << " in " << text;
  EXPECT_EQ(without_secrets(""), "");
  EXPECT_EQ(without_secrets("a\n\nb"), "a\n\nb");
}

TEST(Tar, HasItsHeadersAndBlocksAsPosixSays) {
  const auto tar = tar_of({{"a.txt", "hello"}, {"empty", ""}}, UtcTime::from_us(8'000'000));
  ASSERT_EQ(tar.size(), 512u * 5) << "header, one block, header, two of zeros";
  EXPECT_EQ(tar.substr(0, 6), std::string("a.txt\0", 6));
  EXPECT_EQ(tar.substr(124, 12), std::string("00000000005\0", 12));
  EXPECT_EQ(tar.substr(136, 12), std::string("00000000010\0", 12)) << "seconds, octal";
  EXPECT_EQ(tar.substr(257, 8), std::string("ustar\00000", 8));
  std::uint64_t sum = 0;
  for (std::size_t i = 0; i < 512; ++i) sum += i >= 148 && i < 156 ? ' ' : static_cast<unsigned char>(tar[i]);
  EXPECT_EQ(std::stoull(tar.substr(148, 6), nullptr, 8), sum);
  EXPECT_EQ(tar.substr(512, 5), "hello");
  EXPECT_EQ(tar.substr(1024, 5), "empty");
}

}  // namespace
}  // namespace anchord::api::support_bundle_test
