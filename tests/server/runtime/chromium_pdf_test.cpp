#include "server/runtime/chromium_pdf.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

#include "tests/scratch_dir.hpp"

namespace anchord::server::chromium_pdf_test {
namespace {

std::string content(const std::filesystem::path& file) {
  std::ostringstream text;
  text << std::ifstream(file, std::ios::binary).rdbuf();
  return text.str();
}

/// chromium is one of the packages of the tests (.ci/packages); elsewhere it may be missing.
class ChromiumPdf : public ::testing::Test {
 protected:
  void SetUp() override {
    if (::access("/usr/bin/chromium", X_OK) != 0)
      GTEST_SKIP() << "NOT TESTED: Debian package chromium is not installed";
  }
};

TEST_F(ChromiumPdf, PrintsAPageOfItsOwnAndLeavesNothingElse) {
  const ScratchDir dir;
  const auto page = dir.path() / "a report.html", pdf = dir.path() / "report.pdf";
  std::ofstream(page) << "<!doctype html><meta charset=utf-8><h1>Hall \xC3\xA9 &amp; &lt;b&gt;</h1>"
                         "<img src=http://192.0.2.1/x.png>";
  const auto printed = print_with_chromium(page, pdf);
  ASSERT_TRUE(printed) << printed.error().message;
  const std::string bytes = content(pdf);
  EXPECT_TRUE(bytes.starts_with("%PDF-")) << bytes.substr(0, 20);
  EXPECT_NE(bytes.find("%%EOF"), std::string::npos);
  std::size_t n = 0;
  for ([[maybe_unused]] const auto& left : std::filesystem::directory_iterator(dir.path())) ++n;
  EXPECT_EQ(n, 2u) << "its profile is gone";
}

TEST_F(ChromiumPdf, PrintsInAFolderOfARelativePathWithSignsThatAddressesReadOtherwise) {
  const ScratchDir dir;
  const auto folder = dir.path() / "50% of #2?";
  std::filesystem::create_directory(folder);
  std::ofstream(folder / "report.html") << "<!doctype html><meta charset=utf-8><h1>Hall</h1>";
  const auto relative = std::filesystem::proximate(folder);
  ASSERT_TRUE(relative.is_relative());
  const auto printed = print_with_chromium(relative / "report.html", relative / "report.pdf");
  ASSERT_TRUE(printed) << printed.error().message;
  EXPECT_TRUE(content(folder / "report.pdf").starts_with("%PDF-"));
}

TEST_F(ChromiumPdf, SaysThatThereIsNoPage) {
  const ScratchDir dir;
  const auto printed =
      print_with_chromium(dir.path() / "none" / "x.html", dir.path() / "none" / "report.pdf");
  ASSERT_FALSE(printed);
  EXPECT_EQ(printed.error().code, Errc::internal);
}

}  // namespace
}  // namespace anchord::server::chromium_pdf_test
