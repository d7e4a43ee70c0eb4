#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"

namespace anchord::floor_plan {

enum class ImageFormat : std::uint8_t { png, jpeg, tiff };
inline constexpr auto k_image_format_words = enum_table<ImageFormat>(
    {{"image/png", ImageFormat::png}, {"image/jpeg", ImageFormat::jpeg}, {"image/tiff", ImageFormat::tiff}});

/// Larger plans are refused before anything is decoded. 100 million pixels are A0 at 250 dots per inch.
inline constexpr std::size_t k_max_image_bytes = std::size_t{50} << 20;
inline constexpr std::int64_t k_max_image_side_px = 30'000;
inline constexpr std::int64_t k_max_image_pixels = 100'000'000;

/// Where a GeoTIFF says that it lies: map = matrix * (x, y, 1), pixels as in georeference.hpp.
struct GeoTags {
  Eigen::Matrix<double, 2, 3> map_from_pixel = Eigen::Matrix<double, 2, 3>::Zero();
  int epsg{};
  bool geographic{false};  ///< the map's numbers are degrees, longitude first
};

struct ImageHead {
  ImageFormat format{ImageFormat::png};
  std::int64_t width_px{}, height_px{};
  std::optional<GeoTags> geo{};
};

/// What the first bytes of a file say, without decoding any of it: no library, no allocation that grows with
/// the image. Reads PNG (IHDR), JPEG (its frame header) and classic TIFF (first directory, GeoTIFF 1.1).
///
/// errors   unsupported (none of the three formats; a GeoTIFF of a kind that cannot be placed is read without
///          its tags), bad_frame (cut short or broken), invalid_argument (too large)
/// threads  pure
Result<ImageHead> image_head(std::span<const std::byte> bytes);

}  // namespace anchord::floor_plan
