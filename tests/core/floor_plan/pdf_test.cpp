// What poppler's programs print about a PDF, as pdfinfo 22.12 of Debian 12 printed it, and what to draw.
#include "core/floor_plan/pdf.hpp"

#include <gtest/gtest.h>

namespace anchord::floor_plan::pdf_test {
namespace {

constexpr std::string_view k_told =
    "Custom Metadata: no\nMetadata Stream: no\nTagged:          no\nUserProperties:  no\nSuspects:        "
    "no\n"
    "Form:            none\nJavaScript:      no\nPages:           2\nEncrypted:       no\n"
    "Page    2 size:  842 x 595.276 pts (A4)\nPage    2 rot:   90\nFile size:       0 bytes\nPDF version:    "
    " 1.4\n";

bool pdf(std::string_view text) { return is_pdf(std::as_bytes(std::span(text))); }

TEST(Pdf, IsToldByItsHeaderNearTheBegin) {
  EXPECT_TRUE(pdf("%PDF-1.7\n"));
  EXPECT_TRUE(pdf(std::string(1024, ' ') + "%PDF-1.4"));  // as printers' spoolers leave it
  EXPECT_FALSE(pdf(std::string(1100, ' ') + "%PDF-1.4"));
  EXPECT_FALSE(pdf("%PDF"));
  EXPECT_FALSE(pdf(""));
}

TEST(Pdf, PageHasTheSizeInWhichItIsShown) {
  const auto page = read_pdf_info(k_told, 2);
  ASSERT_TRUE(page) << page.error().message;
  EXPECT_EQ(page.value().pages, 2);
  EXPECT_DOUBLE_EQ(page.value().width_pt, 595.276) << "it is turned by 90 degrees";
  EXPECT_DOUBLE_EQ(page.value().height_pt, 842);
}

TEST(Pdf, PageThatIsNotThereIsRefusedWithTheCount) {
  for (const int wrong : {0, -1, 3, 9999}) {
    const auto page = read_pdf_info(k_told, wrong);
    ASSERT_FALSE(page) << wrong;
    EXPECT_EQ(page.error().code, Errc::invalid_argument);
    EXPECT_NE(page.error().message.find("has 2 pages"), std::string::npos) << page.error().message;
  }
}

TEST(Pdf, AnswerWithoutASizeIsAnErrorAndNoGuess) {
  for (const std::string_view text :
       {"", "Pages:", "Pages:           0\n", "Pages:           1\n",
        "Pages:           1\nPage    1 size:  \n", "Pages:           1\nPage    1 size:  842 x\n",
        "Pages:           1\nPage    1 size:  0 x 5 pts\n",
        "Pages:           1\nPage    1 size:  nan x 5 pts\n",
        "Pages:           1\nPage    1 size:  -4 x 5 pts\n"}) {
    const auto page = read_pdf_info(text, 1);
    ASSERT_FALSE(page) << text;
    EXPECT_EQ(page.error().code, Errc::bad_frame) << text;
  }
}

// 100 million pixels and 30 000 a side are the most of a plan (image_head.hpp); an inch of paper is 72
// points.
TEST(Pdf, IsDrawnNoFinerThanAPlanMayBe) {
  EXPECT_DOUBLE_EQ(drawable_dpi({1, 842, 595}, 200).value(), 200);  // A4
  const double a0 = drawable_dpi({1, 3370, 2384}, 600).value();
  EXPECT_LT(a0 * a0 * 3370 * 2384 / (72 * 72), 100e6);
  EXPECT_GT(a0, 250);
  const double strip =
      drawable_dpi({1, 14400, 72}, 600).value();  // 200 inches: the longest page of a PDF 1.x
  EXPECT_LE(strip * 200, 30'000);
  const auto field = drawable_dpi({1, 100'000, 100'000}, 200);
  ASSERT_FALSE(field);
  EXPECT_NE(field.error().message.find("35 x 35 m of paper"), std::string::npos) << field.error().message;
}

}  // namespace
}  // namespace anchord::floor_plan::pdf_test
