// Plans as files: their heads, and files that are no plans.
#include "core/floor_plan/image.hpp"

#include <gtest/gtest.h>

#include <cstdio>
#include <cstring>

#include <jpeglib.h>
#include "core/floor_plan/backdrop.hpp"
#include "core/floor_plan/image_head.hpp"
#include "tests/core/floor_plan/pictures.hpp"

namespace anchord::floor_plan::image_test {
namespace {

std::span<const std::byte> image_bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

Image picture(int width, int height) {
  Image image{width, height, 3, {}};
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      image.pixels.insert(image.pixels.end(),
                          {static_cast<std::uint8_t>(x * 3), static_cast<std::uint8_t>(y * 5), 77});
  return image;
}

/// Of 3 channels, or of 4 as a print shop saves it.
std::string jpeg_of(const Image& image, J_COLOR_SPACE colours = JCS_RGB) {
  jpeg_compress_struct jpeg{};
  jpeg_error_mgr faults{};
  jpeg.err = jpeg_std_error(&faults);
  jpeg_create_compress(&jpeg);
  unsigned char* buffer = nullptr;
  unsigned long size = 0;
  jpeg_mem_dest(&jpeg, &buffer, &size);
  jpeg.image_width = static_cast<JDIMENSION>(image.width_px);
  jpeg.image_height = static_cast<JDIMENSION>(image.height_px);
  const int channels = colours == JCS_CMYK ? 4 : 3;
  jpeg.input_components = channels;
  jpeg.in_color_space = colours;
  jpeg_set_defaults(&jpeg);
  jpeg_start_compress(&jpeg, TRUE);
  for (int y = 0; y < image.height_px; ++y) {
    auto* row =
        const_cast<JSAMPROW>(image.pixels.data() + static_cast<std::size_t>(channels * y * image.width_px));
    jpeg_write_scanlines(&jpeg, &row, 1);
  }
  jpeg_finish_compress(&jpeg);
  std::string out(reinterpret_cast<char*>(buffer), size);
  std::free(buffer);
  jpeg_destroy_compress(&jpeg);
  return out;
}

TEST(PlanImage, InColoursOfPrintIsRefusedWithWhatToDo) {
  Image ink{40, 30, 4, std::vector<std::uint8_t>(std::size_t{4} * 40 * 30, 20)};
  const auto jpeg = jpeg_of(ink, JCS_CMYK);
  const auto read = decode_image(image_bytes(jpeg));
  ASSERT_FALSE(read.has_value());
  EXPECT_NE(read.error().message.find("(CMYK): save it as RGB, or as PNG"), std::string::npos)
      << read.error().message;
}

TEST(PlanImage, OfEachFormatIsReadAsItWasWritten) {
  const auto image = picture(40, 30);
  const auto png = encode_png(image);
  ASSERT_TRUE(png.has_value());
  const auto head = image_head(image_bytes(png.value()));
  ASSERT_TRUE(head.has_value());
  EXPECT_EQ(head.value().format, ImageFormat::png);
  EXPECT_EQ(head.value().width_px, 40);
  EXPECT_EQ(head.value().height_px, 30);
  const auto back = decode_image(image_bytes(png.value()));
  ASSERT_TRUE(back.has_value()) << back.error().message;
  EXPECT_EQ(back.value().pixels, image.pixels);

  const auto jpeg = jpeg_of(image);
  ASSERT_TRUE(image_head(image_bytes(jpeg)).has_value());
  EXPECT_EQ(image_head(image_bytes(jpeg)).value().width_px, 40);
  const auto lossy = decode_image(image_bytes(jpeg));
  ASSERT_TRUE(lossy.has_value()) << lossy.error().message;
  EXPECT_NEAR(lossy.value().pixels[3 * (10 * 40 + 20)], 60, 12);  // quality 75

  for (const bool big_endian : {false, true}) {
    const auto grey = decode_image(image_bytes(tiff(big_endian, false)));
    ASSERT_TRUE(grey.has_value()) << grey.error().message;
    EXPECT_EQ(grey.value().width_px, 4);
    EXPECT_EQ(grey.value().pixels[3], 0x40);
    EXPECT_EQ(grey.value().pixels[3 * 11 + 2], 0xe0);
  }
}

TEST(PlanImage, OfGeoTiffKnowsWhereItLies) {
  for (const bool big_endian : {false, true}) {
    const auto head = image_head(image_bytes(tiff(big_endian, false)));
    ASSERT_TRUE(head.has_value()) << head.error().message;
    ASSERT_TRUE(head.value().geo);
    EXPECT_EQ(head.value().geo->epsg, 25831);
    EXPECT_FALSE(head.value().geo->geographic);
    const Eigen::Vector2d at = head.value().geo->map_from_pixel * Eigen::Vector3d(2, 1, 1);
    EXPECT_NEAR(at.x(), 500001, 1e-9);
    EXPECT_NEAR(at.y(), 5600000 - 0.25, 1e-9);
  }
  const auto point = image_head(image_bytes(tiff(false, true)));
  const Eigen::Vector2d middle = point.value().geo->map_from_pixel * Eigen::Vector3d(0.5, 0.5, 1);
  EXPECT_NEAR(middle.x(), 500000, 1e-9);
  EXPECT_TRUE(image_head(image_bytes(tiff(false, false, 2048, 4326))).value().geo->geographic);
  EXPECT_FALSE(
      image_head(image_bytes(tiff(false, false, 3072, 32767))).value().geo);  // user-defined: no code
}

TEST(PlanImage, IsRefusedByItsSizeBeforeAnythingIsDecoded) {
  const auto bomb = png_head(50'000, 50'000);
  const auto head = image_head(image_bytes(bomb));
  ASSERT_FALSE(head.has_value());
  EXPECT_EQ(head.error().code, Errc::invalid_argument);
  EXPECT_NE(head.error().message.find("50000 x 50000 pixels (limit 30000"), std::string::npos)
      << head.error().message;
  EXPECT_EQ(decode_image(image_bytes(bomb)).error().code, Errc::invalid_argument);
  EXPECT_EQ(image_head(image_bytes(png_head(0xffffffff, 1))).error().code, Errc::invalid_argument);
  EXPECT_EQ(image_head(image_bytes(png_head(0, 5))).error().code, Errc::bad_frame);
}

TEST(PlanImage, OfAnotherKindIsRefusedWithWhatIsAccepted) {
  for (const auto& file : std::vector<std::string>{"%PDF-1.7 ...", "0\r\nSECTION\r\n", "<svg/>", "",
                                                   std::string("II\x2b\0", 4)}) {
    const auto head = image_head(image_bytes(file));
    ASSERT_FALSE(head.has_value()) << file;
    EXPECT_EQ(head.error().code, Errc::unsupported);
    EXPECT_NE(head.error().message.find("PNG, JPEG, (Geo)TIFF, PDF or ASCII DXF"), std::string::npos);
  }
}

TEST(PlanImage, OfAJpegWithMoreScansThanAnyProgramWritesIsRefused) {
  const auto plain = decode_image(image_bytes(jpeg_of_scans(800, 9)));
  ASSERT_TRUE(plain.has_value()) << plain.error().message;
  EXPECT_EQ(plain.value().pixels.at(0), 128) << "the middle grey that zero stands for";
  const auto bomb = decode_image(image_bytes(jpeg_of_scans(800, 600)));
  ASSERT_FALSE(bomb.has_value());
  EXPECT_EQ(bomb.error().code, Errc::bad_frame);
  EXPECT_NE(bomb.error().message.find("more than 500 scans"), std::string::npos) << bomb.error().message;
}

TEST(PlanImage, CutShortAnywhereIsAnErrorAndNeverHalfAPicture) {
  const auto image = picture(40, 30);
  for (const auto& whole : {encode_png(image).value(), jpeg_of(image), tiff(false, false)}) {
    for (std::size_t n = 0; n < whole.size() - 2; n += n < 64 ? 1 : 7) {
      const auto half = decode_image(image_bytes(whole.substr(0, n)));
      // A PNG that lacks its end mark alone has all its pixels.
      if (!half) continue;
      EXPECT_EQ(half.value().pixels, decode_image(image_bytes(whole)).value().pixels) << n;
      EXPECT_GE(n + 12, whole.size()) << "cut off more than the end mark";
    }
  }
}

TEST(PlanImage, WithAnyByteBrokenIsReadOrRefusedAndNothingElse) {
  const auto image = picture(16, 12);
  for (const auto& whole : {encode_png(image).value(), jpeg_of(image), tiff(false, false)}) {
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const char value : {'\0', '\xff', '\x7f'}) {
        auto spoilt = whole;
        spoilt[i] = value;
        const auto read = decode_image(image_bytes(spoilt));
        if (!read) continue;
        EXPECT_EQ(read.value().pixels.size(),
                  3u * static_cast<unsigned>(read.value().width_px * read.value().height_px));
      }
    }
  }
}

TEST(PlanBackdrop, LiesNorthUpWhereThePlanSays) {
  // 10 x 5 m, 10 cm a pixel, its x axis pointing north: the plan's right lower corner is north-east.
  Image image{100, 50, 3, std::vector<std::uint8_t>(100 * 50 * 3, 255)};
  for (int y = 40; y < 50; ++y)
    for (int x = 90; x < 100; ++x)
      image.pixels[static_cast<std::size_t>(3 * (y * 100 + x))] = 0;  // cyan corner
  PlanTransform transform;
  transform.linear << 0, 0.1, 0.1, 0;
  transform.shift_m = {20, -3};
  const auto out = make_backdrop(image, transform);
  ASSERT_TRUE(out.has_value());
  EXPECT_LT((out.value().low_m - Eigen::Vector2d(20, -3)).norm(), 1e-9);
  EXPECT_LT((out.value().high_m - Eigen::Vector2d(25, 7)).norm(), 1e-9);
  const auto& backdrop = out.value().image;
  EXPECT_EQ(backdrop.width_px, 50);
  EXPECT_EQ(backdrop.height_px, 100);
  const auto at = [&](int x, int y, int channel) {
    return backdrop.pixels[static_cast<std::size_t>(4 * (y * 50 + x) + channel)];
  };
  EXPECT_EQ(at(45, 5, 0), 0);  // north-east
  EXPECT_EQ(at(45, 5, 3), 255);
  EXPECT_EQ(at(5, 5, 0), 255);
  EXPECT_EQ(at(45, 95, 0), 255);
}

TEST(PlanBackdrop, IsTransparentBesideATurnedPlanAndNoLongerThanAsked) {
  Image image{400, 400, 3, std::vector<std::uint8_t>(400 * 400 * 3, 255)};
  PlanTransform transform;
  const double c = 0.1 * std::sqrt(0.5);
  transform.linear << c, c, c, -c;
  const auto out = make_backdrop(image, transform, 200);
  ASSERT_TRUE(out.has_value());
  EXPECT_EQ(std::max(out.value().image.width_px, out.value().image.height_px), 200);
  EXPECT_EQ(out.value().image.pixels[3], 0);
  EXPECT_EQ(out.value().image.pixels[4 * (100 * 200 + 100) + 3], 255);
  transform.linear *= 1000;
  EXPECT_EQ(make_backdrop(image, transform).error().code, Errc::invalid_argument);
}

TEST(PlanImage, IsHalvedUntilItsPngFits) {
  Image noise{256, 256, 3, {}};
  std::uint32_t state = 1;
  for (int i = 0; i < 3 * 256 * 256; ++i)
    noise.pixels.push_back(static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24));
  const auto png = encode_png_within(noise, 60'000);
  ASSERT_TRUE(png.has_value());
  EXPECT_LE(png.value().size(), 60'000u);
  EXPECT_EQ(image_head(image_bytes(png.value())).value().width_px, 128);
}

}  // namespace
}  // namespace anchord::floor_plan::image_test
