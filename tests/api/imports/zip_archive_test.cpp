// Zip files of strangers: every name, size and kind is judged before a byte is used.
#include "api/formats/zip_archive.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "tests/api/zip_builder.hpp"

namespace anchord::api::zip_archive_test {
namespace {

namespace fs = std::filesystem;
using anchord::test::ZipBuilder;
using ::testing::HasSubstr;

class ZipArchive : public ::testing::Test {
 protected:
  fs::path folder_ = fs::path(::testing::TempDir()) /
                     ("zip " + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path file(const std::string& bytes) const {
    const auto path = folder_ / "of a stranger.zip";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  /// Why it is refused; empty where it is read.
  std::string refusal(const std::string& bytes, const ZipLimits& limits = {}) const {
    const auto zip = ZipReader::open(file(bytes), limits);
    if (zip) return {};
    EXPECT_EQ(zip.error().code, Errc::bad_frame);
    return zip.error().message;
  }
};

TEST_F(ZipArchive, GivesBackWhatWasWritten) {
  const auto path = folder_ / "a.zip";
  std::ofstream(folder_ / "rows") << std::string(300'000, 'r');
  auto writer = ZipWriter::create(path);
  ASSERT_TRUE(writer) << writer.error().message;
  ASSERT_TRUE(writer.value().add_text("manifest.json", "{}"));
  ASSERT_TRUE(writer.value().add_file("tables/a.ndjson", folder_ / "rows"));
  ASSERT_TRUE(writer.value().add_file("stored", folder_ / "rows", true));
  ASSERT_TRUE(writer.value().finish());
  EXPECT_GT(fs::file_size(path), 300'000u) << "one of the two is stored";
  EXPECT_LT(fs::file_size(path), 310'000u) << "the other is packed";
  const auto zip = ZipReader::open(path);
  ASSERT_TRUE(zip) << zip.error().message;
  ASSERT_EQ(zip.value().entries().size(), 3u);
  EXPECT_EQ(zip.value().text("manifest.json", 100).value(), "{}");
  EXPECT_EQ(zip.value().sha256_hex("tables/a.ndjson").value(), zip.value().sha256_hex("stored").value());
  EXPECT_EQ(zip.value().text("stored", 300'000).value(), std::string(300'000, 'r'));
  EXPECT_FALSE(zip.value().text("stored", 299'999)) << "more than was asked for is not held";
  EXPECT_EQ(zip.value().stream("other").error().code, Errc::not_found);
}

TEST_F(ZipArchive, IsTheSameFileForTheSameContent) {
  for (const char* name : {"a.zip", "b.zip"}) {
    auto writer = ZipWriter::create(folder_ / name);
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer.value().add_text("x", "content"));
    ASSERT_TRUE(writer.value().finish());
  }
  const auto bytes = [](const fs::path& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string{std::istreambuf_iterator<char>(in), {}};
  };
  EXPECT_EQ(bytes(folder_ / "a.zip"), bytes(folder_ / "b.zip"));
}

TEST_F(ZipArchive, ReadsWhatAnotherWriterMade) {
  EXPECT_EQ(refusal(ZipBuilder().add("a/b.txt", "text").bytes()), "");
  EXPECT_EQ(refusal(ZipBuilder().add({"a", std::string(1000, 'a'), true}).bytes()), "");
}

TEST_F(ZipArchive, RefusesNamesThatLeaveTheFolder) {
  for (const char* name : {"../x", "a/../../x", "/etc/x", "a//b", "./x", "a/.", "..", "C:/x", "a\\..\\x",
                           "a b", "~x", "folder/"})
    EXPECT_NE(refusal(ZipBuilder().add(name, "x").bytes()), "") << name;
}

TEST_F(ZipArchive, RefusesANameTwiceWhateverItsCase) {
  EXPECT_NE(refusal(ZipBuilder().add("a", "x").add("a", "y").bytes()), "");
  EXPECT_THAT(refusal(ZipBuilder().add("a", "x").add("A", "y").bytes()), HasSubstr("twice"));
}

TEST_F(ZipArchive, RefusesLinksDevicesAndFolders) {
  for (const std::uint32_t mode : {0120777u, 0040755u, 0020666u, 0010644u})
    EXPECT_THAT(refusal(ZipBuilder().add({"a", "/etc/passwd", false, mode}).bytes()), HasSubstr("link"));
}

TEST_F(ZipArchive, RefusesEncryptedEntries) {
  EXPECT_THAT(refusal(ZipBuilder().add({"a", "secret", false, 0100600, 0xFFFFFFFF, 1}).bytes()),
              HasSubstr("encrypted"));
}

TEST_F(ZipArchive, RefusesABombBeforeItIsUnpacked) {
  // 32 MiB of zeros take 32 KiB: a thousand to one, the most that deflate can.
  const std::string bomb = ZipBuilder().add({"a", std::string(std::size_t{32} << 20, '\0'), true}).bytes();
  ASSERT_LT(bomb.size(), 64'000u);
  EXPECT_THAT(refusal(bomb), HasSubstr("300 times the file"));
}

TEST_F(ZipArchive, RefusesMoreThanTheLimitsSay) {
  ZipBuilder many;
  for (int i = 0; i < 5; ++i) many.add("entry" + std::to_string(i), std::string(100, 'x'));
  ZipLimits limits;
  EXPECT_EQ(refusal(many.bytes(), limits), "");
  limits.entries = 4;
  EXPECT_THAT(refusal(many.bytes(), limits), HasSubstr("at most 4"));
  limits = {};
  limits.entry_bytes = 99;
  EXPECT_THAT(refusal(many.bytes(), limits), HasSubstr("too large"));
  limits = {};
  limits.total_bytes = 499;
  EXPECT_THAT(refusal(many.bytes(), limits), HasSubstr("too large"));
}

TEST_F(ZipArchive, StopsAtTheSizeAnEntrySays) {
  const auto path = file(ZipBuilder().add({"a", std::string(1000, 'a'), true, 0100600, 10}).bytes());
  const auto zip = ZipReader::open(path);
  if (!zip) return;  // judged at the door already
  EXPECT_FALSE(zip.value().sha256_hex("a"));
  EXPECT_FALSE(zip.value().text("a", 5000));
}

TEST_F(ZipArchive, RefusesAFileCutOffAnywhere) {
  const std::string whole = ZipBuilder().add("a", std::string(200, 'x')).add("b", "y").bytes();
  ASSERT_EQ(refusal(whole), "");
  for (std::size_t n = 0; n < whole.size(); ++n) EXPECT_NE(refusal(whole.substr(0, n)), "") << n << " bytes";
}

TEST_F(ZipArchive, TellsAContentThatDoesNotFitItsChecksum) {
  std::string bytes = ZipBuilder().add("a", "content").bytes();
  bytes[bytes.find("content")] = 'C';
  const auto zip = ZipReader::open(file(bytes));
  ASSERT_TRUE(zip);
  EXPECT_FALSE(zip.value().sha256_hex("a"));
}

}  // namespace
}  // namespace anchord::api::zip_archive_test
