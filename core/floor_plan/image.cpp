#include "core/floor_plan/image.hpp"

#include <algorithm>
#include <csetjmp>
#include <cstdarg>
#include <cstdio>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/floor_plan/image_head.hpp"
// These two need <cstdio> before them.
#include <jerror.h>
#include <jpeglib.h>
#include <png.h>
#include <tiffio.h>

namespace anchord::floor_plan {
namespace {

using Bytes = std::span<const std::byte>;

Error broken(const std::string& why) {
  return make_error(Errc::bad_frame, "the image cannot be decoded (" + why +
                                         "): the file is broken or cut short; save it again");
}

Image blank(const ImageHead& head) {
  Image image{static_cast<int>(head.width_px), static_cast<int>(head.height_px), 3, {}};
  image.pixels.resize(3 * static_cast<std::size_t>(head.width_px) * static_cast<std::size_t>(head.height_px));
  return image;
}

Result<Image> decode_png(Bytes bytes, const ImageHead& head) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  const std::unique_ptr<png_image, void (*)(png_image*)> guard(&png, png_image_free);
  if (png_image_begin_read_from_memory(&png, bytes.data(), bytes.size()) == 0) return broken(png.message);
  png.format = PNG_FORMAT_RGB;
  Image image = blank(head);
  if (PNG_IMAGE_SIZE(png) != image.pixels.size()) return broken("its size changes");
  const png_color white{255, 255, 255};
  if (png_image_finish_read(&png, &white, image.pixels.data(), 0, nullptr) == 0) return broken(png.message);
  return image;
}

/// libjpeg reports by long jumps; between setjmp and its end no object of C++ is made.
struct JpegFaults {
  jpeg_error_mgr base;
  std::jmp_buf back;
  char message[JMSG_LENGTH_MAX];
  bool cut_short;
  bool of_print;  ///< CMYK
};

/// A progressive file has some ten scans. Each is a pass over the whole picture for a few bytes of file.
constexpr int k_max_jpeg_scans = 500;

extern "C" {
void anchord_jpeg_exit(j_common_ptr jpeg) {
  auto* faults = reinterpret_cast<JpegFaults*>(jpeg->err);
  (*jpeg->err->format_message)(jpeg, faults->message);
  std::longjmp(faults->back, 1);
}
void anchord_jpeg_emit(j_common_ptr jpeg, int level) {
  auto* faults = reinterpret_cast<JpegFaults*>(jpeg->err);
  // Of the warnings only these mean that part of the picture is invented.
  if (level < 0 && (jpeg->err->msg_code == JWRN_JPEG_EOF || jpeg->err->msg_code == JWRN_HIT_MARKER))
    faults->cut_short = true;
}
void anchord_jpeg_progress(j_common_ptr jpeg) {
  if (reinterpret_cast<j_decompress_ptr>(jpeg)->input_scan_number <= k_max_jpeg_scans) return;
  auto* faults = reinterpret_cast<JpegFaults*>(jpeg->err);
  std::snprintf(faults->message, sizeof faults->message, "it has more than %d scans", k_max_jpeg_scans);
  std::longjmp(faults->back, 1);
}
}

bool read_jpeg(Bytes bytes, Image& image, JpegFaults& faults) {
  jpeg_decompress_struct jpeg{};
  jpeg_progress_mgr progress{};
  progress.progress_monitor = anchord_jpeg_progress;
  jpeg.err = jpeg_std_error(&faults.base);
  faults.base.error_exit = anchord_jpeg_exit;
  faults.base.emit_message = anchord_jpeg_emit;
  if (setjmp(faults.back) != 0) {  // NOLINT: the only way libjpeg has
    jpeg_destroy_decompress(&jpeg);
    return false;
  }
  jpeg_create_decompress(&jpeg);
  jpeg.progress = &progress;
  jpeg_mem_src(&jpeg, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&jpeg, TRUE);
  if (jpeg.jpeg_color_space == JCS_CMYK || jpeg.jpeg_color_space == JCS_YCCK) {
    jpeg_destroy_decompress(&jpeg);
    faults.of_print = true;
    return false;
  }
  jpeg.out_color_space = JCS_RGB;
  jpeg_start_decompress(&jpeg);
  const std::size_t stride = 3 * std::size_t{jpeg.output_width};
  bool fits = jpeg.output_components == 3 && stride * jpeg.output_height == image.pixels.size();
  while (fits && jpeg.output_scanline < jpeg.output_height) {
    JSAMPROW row = image.pixels.data() + jpeg.output_scanline * stride;
    jpeg_read_scanlines(&jpeg, &row, 1);
  }
  if (fits) jpeg_finish_decompress(&jpeg);
  jpeg_destroy_decompress(&jpeg);
  if (!fits) std::strcpy(faults.message, "its size changes");
  return fits;
}

Result<Image> decode_jpeg(Bytes bytes, const ImageHead& head) {
  Image image = blank(head);
  auto faults = std::make_unique<JpegFaults>();
  if (const bool read = read_jpeg(bytes, image, *faults); !read && faults->of_print)
    return make_error(Errc::unsupported,
                      "the JPEG file has the colours of print (CMYK): save it as RGB, or as PNG");
  else if (!read)
    return broken(faults->message);
  if (faults->cut_short) return broken("it ends before the last row");
  return image;
}

/// A file in memory, as libtiff wants it, and the newest fault it told.
struct TiffFile {
  Bytes bytes;
  std::size_t at{0};
  std::string fault{};
};

tmsize_t tiff_read(thandle_t handle, void* to, tmsize_t n) {
  auto& file = *static_cast<TiffFile*>(handle);
  const std::size_t there = file.at < file.bytes.size() ? file.bytes.size() - file.at : 0;
  const std::size_t taken = std::min(there, static_cast<std::size_t>(std::max<tmsize_t>(n, 0)));
  std::memcpy(to, file.bytes.data() + std::min(file.at, file.bytes.size()), taken);
  file.at += taken;
  return static_cast<tmsize_t>(taken);
}
tmsize_t tiff_write(thandle_t, void*, tmsize_t) { return 0; }
toff_t tiff_seek(thandle_t handle, toff_t to, int from) {
  auto& file = *static_cast<TiffFile*>(handle);
  const toff_t base = from == SEEK_CUR ? file.at : from == SEEK_END ? file.bytes.size() : 0;
  file.at = static_cast<std::size_t>(base + to);
  return file.at;
}
int tiff_close(thandle_t) { return 0; }
toff_t tiff_size(thandle_t handle) { return static_cast<TiffFile*>(handle)->bytes.size(); }
int tiff_fault(TIFF*, void* user, const char*, const char* format, va_list values) {
  char text[300];
  std::vsnprintf(text, sizeof text, format, values);
  static_cast<TiffFile*>(user)->fault = text;
  return 1;
}
int tiff_quiet(TIFF*, void*, const char*, const char*, va_list) { return 1; }

Result<Image> decode_tiff(Bytes bytes, const ImageHead& head) {
  TiffFile file{bytes};
  const std::unique_ptr<TIFFOpenOptions, void (*)(TIFFOpenOptions*)> options(TIFFOpenOptionsAlloc(),
                                                                             TIFFOpenOptionsFree);
  TIFFOpenOptionsSetErrorHandlerExtR(options.get(), tiff_fault, &file);
  TIFFOpenOptionsSetWarningHandlerExtR(options.get(), tiff_quiet, nullptr);
  // One strip or tile is never larger than the whole picture with 8 bytes a pixel.
  TIFFOpenOptionsSetMaxSingleMemAlloc(options.get(),
                                      static_cast<tmsize_t>(8 * head.width_px * head.height_px + (1 << 20)));
  const std::unique_ptr<TIFF, void (*)(TIFF*)> tiff(
      TIFFClientOpenExt("plan", "rm", &file, tiff_read, tiff_write, tiff_seek, tiff_close, tiff_size, nullptr,
                        nullptr, options.get()),
      [](TIFF* t) {
        if (t != nullptr) TIFFClose(t);
      });
  if (!tiff) return broken(file.fault);
  char why[1024] = "";
  if (TIFFRGBAImageOK(tiff.get(), why) == 0)
    return make_error(Errc::unsupported, std::string("this kind of TIFF is not supported (") + why +
                                             "): save it as 8-bit RGB or grey");
  std::vector<std::uint32_t> raster(static_cast<std::size_t>(head.width_px * head.height_px));
  if (TIFFReadRGBAImageOriented(tiff.get(), static_cast<std::uint32_t>(head.width_px),
                                static_cast<std::uint32_t>(head.height_px), raster.data(),
                                ORIENTATION_TOPLEFT, 1) == 0)
    return broken(file.fault);
  Image image = blank(head);
  std::uint8_t* to = image.pixels.data();
  for (const std::uint32_t pixel : raster) {
    const std::uint32_t opacity = TIFFGetA(pixel);
    // libtiff gives colours multiplied by their opacity: white paper adds what is missing of it.
    for (const std::uint32_t colour : {TIFFGetR(pixel), TIFFGetG(pixel), TIFFGetB(pixel)})
      *to++ = static_cast<std::uint8_t>(std::min<std::uint32_t>(255, colour + 255 - opacity));
  }
  return image;
}

}  // namespace

Result<Image> decode_image(Bytes bytes) {
  BOOST_OUTCOME_TRY(const auto head, image_head(bytes));
  switch (head.format) {
    case ImageFormat::png:
      return decode_png(bytes, head);
    case ImageFormat::jpeg:
      return decode_jpeg(bytes, head);
    case ImageFormat::tiff:
      return decode_tiff(bytes, head);
  }
  return make_error(Errc::internal, "unknown image format");
}

Result<std::string> encode_png(const Image& image, PngEffort effort) {
  png_image png{};
  png.version = PNG_IMAGE_VERSION;
  png.width = static_cast<png_uint_32>(image.width_px);
  png.height = static_cast<png_uint_32>(image.height_px);
  png.format = image.channels == 1 ? PNG_FORMAT_GRAY : image.channels == 3 ? PNG_FORMAT_RGB : PNG_FORMAT_RGBA;
  if (effort == PngEffort::fast) png.flags |= PNG_IMAGE_FLAG_FAST;
  std::string out(PNG_IMAGE_PNG_SIZE_MAX(png), '\0');
  png_alloc_size_t size = out.size();
  if (png_image_write_to_memory(&png, out.data(), &size, 0, image.pixels.data(), 0, nullptr) == 0)
    return make_error(Errc::internal, std::string("cannot write a PNG: ") + png.message);
  out.resize(size);
  out.shrink_to_fit();
  return out;
}

Image shrunk(Image image, int longest_side_px) {
  const int longest = std::max(image.width_px, image.height_px);
  if (longest <= longest_side_px) return image;
  const double by = static_cast<double>(longest_side_px) / longest;
  Image out{std::max(1, static_cast<int>(image.width_px * by)),
            std::max(1, static_cast<int>(image.height_px * by)),
            image.channels,
            {}};
  out.pixels.resize(static_cast<std::size_t>(out.channels) * static_cast<std::size_t>(out.width_px) *
                    static_cast<std::size_t>(out.height_px));
  const cv::Mat from(image.height_px, image.width_px, CV_8UC(image.channels), image.pixels.data());
  cv::Mat to(out.height_px, out.width_px, CV_8UC(out.channels), out.pixels.data());
  cv::resize(from, to, to.size(), 0, 0, cv::INTER_AREA);
  return out;
}

Result<std::string> encode_png_within(Image image, std::size_t max_bytes) {
  while (true) {
    BOOST_OUTCOME_TRY(auto png, encode_png(image));
    if (png.size() <= max_bytes || std::max(image.width_px, image.height_px) < 64) return png;
    image = shrunk(std::move(image), std::max(image.width_px, image.height_px) / 2);
  }
}

}  // namespace anchord::floor_plan
