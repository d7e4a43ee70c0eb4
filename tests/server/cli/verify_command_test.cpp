// The real binary, as somebody who was handed a pack calls it: no server, no database.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include "api/formats/bundle.hpp"
#include "api/formats/handover.hpp"
#include "core/base/sha256.hpp"
#include "tests/paths.hpp"

namespace anchord::api::verify_command_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

std::string text_of(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}
std::string sha256(const std::string& text) {
  Sha256 sum;
  sum.add(text);
  return sum.hex();
}
Ed25519Key key_of(std::uint8_t first) {
  Ed25519Key::Seed seed{};
  seed[0] = first;
  return Ed25519Key(seed);
}

struct Answer {
  int exit_code{};
  std::string out, err;
};

class VerifyCommand : public ::testing::Test {
 protected:
  // A space in the path, on purpose; one folder per test, since tests run side by side.
  fs::path folder_ =
      fs::path(::testing::TempDir()) /
      ("anchord verify " + std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
    save("server.pem", key_.open_half().pem());
  }
  void TearDown() override { fs::remove_all(folder_); }
  void save(const char* name, const std::string& text) const {
    std::ofstream(folder_ / name, std::ios::binary) << text;
  }
  std::string quoted(const char* name) const { return "'" + (folder_ / name).string() + "'"; }
  Answer run(const std::string& command) const {
    const int status =
        std::system(("{ " + command + " ; } >" + quoted("out") + " 2>" + quoted("err")).c_str());
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, text_of(folder_ / "out"), text_of(folder_ / "err")};
  }
  Answer verify(const std::string& arguments) const {
    return run(std::string("'") + ANCHORD_BINARY + "' verify " + arguments);
  }
  /// A pack of two files; `report` is what the list says of it.
  void pack(const char* name, const std::string& report_in_it, const std::string& report_in_list,
            const Ed25519Key& signer, bool with_extra = false) {
    sums_ =
        pack_sums({{"report.html", sha256(report_in_list)}, {"key.pem", sha256(signer.open_half().pem())}});
    signature_ = signer.sign(sums_);
    auto zip = ZipWriter::create(folder_ / name);
    ASSERT_TRUE(zip);
    ASSERT_TRUE(zip.value().add_text("report.html", report_in_it));
    ASSERT_TRUE(zip.value().add_text("key.pem", signer.open_half().pem()));
    ASSERT_TRUE(zip.value().add_text("SHA256SUMS", sums_));
    ASSERT_TRUE(zip.value().add_text("SHA256SUMS.sig", signature_));
    if (with_extra) {
      ASSERT_TRUE(zip.value().add_text("extra.txt", "x"));
    }
    ASSERT_TRUE(zip.value().finish());
  }
  Ed25519Key key_ = key_of(1);
  std::string sums_, signature_;
};

TEST_F(VerifyCommand, SaysThatAPackIsWholeAndWhoSignedIt) {
  pack("pack.zip", "page", "page", key_);
  const auto own = verify(quoted("pack.zip"));
  EXPECT_EQ(own.exit_code, 0) << own.out << own.err;
  EXPECT_THAT(own.out, HasSubstr("signed with the key in the pack"));
  const auto given = verify(quoted("pack.zip") + " --key " + quoted("server.pem"));
  EXPECT_EQ(given.exit_code, 0) << given.out << given.err;
  EXPECT_THAT(given.out, HasSubstr("signed with the key given, " + key_.open_half().id()));
}

TEST_F(VerifyCommand, NamesAFileThatDiffers) {
  pack("pack.zip", "forged", "page", key_);
  const auto answer = verify(quoted("pack.zip"));
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.out, HasSubstr("report.html was changed"));
}

TEST_F(VerifyCommand, NamesAFileThatNobodyListed) {
  pack("pack.zip", "page", "page", key_, true);
  const auto answer = verify(quoted("pack.zip"));
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.out, HasSubstr("extra.txt is not in the list"));
}

TEST_F(VerifyCommand, RefusesAnotherServersSignature) {
  pack("pack.zip", "page", "page", key_of(2));
  EXPECT_EQ(verify(quoted("pack.zip")).exit_code, 0) << "whole in itself: its own key says so";
  const auto answer = verify(quoted("pack.zip") + " --key " + quoted("server.pem"));
  EXPECT_EQ(answer.exit_code, 1);
  EXPECT_THAT(answer.out, HasSubstr("the signature does not match key " + key_.open_half().id()));
}

TEST_F(VerifyCommand, SaysWhatCannotBeUsed) {
  pack("pack.zip", "page", "page", key_);
  save("cut.zip", text_of(folder_ / "pack.zip").substr(0, 200));
  save("text.zip", "no zip file");
  save("no.pem", "no key");
  EXPECT_EQ(verify(quoted("absent.zip")).exit_code, 2);
  EXPECT_EQ(verify(quoted("cut.zip")).exit_code, 2);
  EXPECT_THAT(verify(quoted("text.zip")).err, HasSubstr("not a complete zip file"));
  EXPECT_EQ(verify(quoted("pack.zip") + " --key " + quoted("no.pem")).exit_code, 2);
  EXPECT_EQ(verify(quoted("pack.zip") + " --key " + quoted("absent.pem")).exit_code, 2);
}

TEST_F(VerifyCommand, ReadsABundleAlone) {
  BundleManifest manifest;
  manifest.mission = MissionId{parse_uuid("0197a3b0-5d10-7b1e-9c55-0a1b2c3d4e5f").value()};
  manifest.entries = {{"tables/a.ndjson", 4, 0, sha256("[]\n\n")}};
  for (const char* content : {"[]\n\n", "[1]\n"}) {
    const bool same = content == std::string("[]\n\n");
    const char* name = same ? "good.anchord" : "bad.anchord";
    auto zip = ZipWriter::create(folder_ / name);
    ASSERT_TRUE(zip);
    ASSERT_TRUE(zip.value().add_text("manifest.json", write_bundle_manifest(manifest)));
    ASSERT_TRUE(zip.value().add_text("tables/a.ndjson", content));
    ASSERT_TRUE(zip.value().finish());
    const auto answer = verify(quoted(name));
    EXPECT_EQ(answer.exit_code, same ? 0 : 1) << answer.out << answer.err;
    EXPECT_THAT(answer.out, HasSubstr(same ? "not signed" : "tables/a.ndjson does not have the digest"));
  }
}

TEST_F(VerifyCommand, AgreesWithOpenSslAboutTheSignature) {
  if (run("openssl version").exit_code != 0) GTEST_SKIP() << "no openssl here";
  pack("pack.zip", "page", "page", key_);
  save("sums", sums_);
  save("sig", signature_);
  const std::string command = "openssl pkeyutl -verify -pubin -inkey " + quoted("server.pem") +
                              " -rawin -in " + quoted("sums") + " -sigfile " + quoted("sig");
  const auto good = run(command);
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  save("sums", sums_ + " ");
  EXPECT_NE(run(command).exit_code, 0);
}

}  // namespace
}  // namespace anchord::api::verify_command_test
