#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::floor_plan {

/// Rows from the top, channels interleaved, 8 bits each: 1 grey, 3 RGB, 4 RGB with opacity.
struct Image {
  int width_px{}, height_px{}, channels{};
  std::vector<std::uint8_t> pixels;
};

/// A whole PNG, JPEG or TIFF as RGB; what is transparent becomes white paper. Decoders are other people's C
/// on bytes of a stranger: to be called in the worker process alone (architecture.md).
///
/// errors   those of image_head; bad_frame (cut short or broken), unsupported (a kind of JPEG or TIFF that is
///          not read)
/// memory   7 bytes a pixel at most, and what the decoder needs beside
Result<Image> decode_image(std::span<const std::byte> bytes);

enum class PngEffort : std::uint8_t { small, fast };
/// PNG of an image; fast: of a photograph in a tenth of the time and twice the bytes, of a drawing in half
/// the time.
Result<std::string> encode_png(const Image& image, PngEffort effort = PngEffort::small);
/// PNG of at most `max_bytes`: halved until it fits.
Result<std::string> encode_png_within(Image image, std::size_t max_bytes);
/// Scaled down so that neither side is longer; unchanged where none is.
Image shrunk(Image image, int longest_side_px);

}  // namespace anchord::floor_plan
