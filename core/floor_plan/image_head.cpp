#include "core/floor_plan/image_head.hpp"

#include <Eigen/LU>
#include <array>
#include <bit>
#include <cmath>
#include <string>
#include <vector>

namespace anchord::floor_plan {
namespace {

using Bytes = std::span<const std::byte>;

/// Numbers of a file at places that the file itself names: nothing is read beyond the end.
class Numbers {
 public:
  Numbers(Bytes bytes, bool big_endian) : bytes_(bytes), big_(big_endian) {}
  std::size_t size() const { return bytes_.size(); }
  std::optional<std::uint64_t> at(std::uint64_t offset, std::size_t n) const {
    if (offset > bytes_.size() || bytes_.size() - offset < n) return std::nullopt;
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < n; ++i) {
      const auto byte = std::to_integer<std::uint64_t>(bytes_[static_cast<std::size_t>(offset) + i]);
      value |= byte << 8 * (big_ ? n - 1 - i : i);
    }
    return value;
  }

 private:
  Bytes bytes_;
  bool big_;
};

Error cut_short(const char* what) {
  return make_error(Errc::bad_frame, std::string("the image ends inside its ") + what +
                                         ": the file is cut short; send it again");
}

template <std::size_t N>
bool begins(Bytes bytes, const std::array<unsigned char, N>& magic) {
  if (bytes.size() < N) return false;
  for (std::size_t i = 0; i < N; ++i)
    if (std::to_integer<unsigned char>(bytes[i]) != magic[i]) return false;
  return true;
}

constexpr std::array<unsigned char, 8> k_png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
constexpr std::array<unsigned char, 3> k_jpeg{0xff, 0xd8, 0xff};
constexpr std::array<unsigned char, 4> k_tiff_little{'I', 'I', 42, 0}, k_tiff_big{'M', 'M', 0, 42};
constexpr std::array<unsigned char, 4> k_bigtiff_little{'I', 'I', 43, 0}, k_bigtiff_big{'M', 'M', 0, 43};

/// PNG specification section 11.2.2: the first chunk is IHDR, width and height its first numbers.
Result<ImageHead> png_head(Bytes bytes) {
  const Numbers in(bytes, true);
  const auto name = in.at(12, 4), width = in.at(16, 4), height = in.at(20, 4);
  if (!name || !width || !height) return cut_short("header");
  if (*name != 0x49484452)
    return make_error(Errc::bad_frame, "the PNG does not begin with its header (IHDR): the file is broken");
  return ImageHead{
      ImageFormat::png, static_cast<std::int64_t>(*width), static_cast<std::int64_t>(*height), {}};
}

/// ITU-T T.81 annex B: segments with their lengths until the frame header, SOF0 to SOF15.
Result<ImageHead> jpeg_head(Bytes bytes) {
  const Numbers in(bytes, true);
  std::uint64_t at = 2;
  while (true) {
    const auto marker = in.at(at, 2), length = in.at(at + 2, 2);
    if (!marker || !length) return cut_short("header");
    if (*marker == 0xffff) {  // fill byte
      ++at;
      continue;
    }
    if (*marker < 0xffc0 || *length < 2)
      return make_error(Errc::bad_frame, "the JPEG's header is broken: save the image again");
    // DHT, JPG and DAC share the range and are no frame headers.
    if (*marker <= 0xffcf && *marker != 0xffc4 && *marker != 0xffc8 && *marker != 0xffcc) {
      const auto height = in.at(at + 5, 2), width = in.at(at + 7, 2);
      if (!height || !width) return cut_short("header");
      return ImageHead{
          ImageFormat::jpeg, static_cast<std::int64_t>(*width), static_cast<std::int64_t>(*height), {}};
    }
    if (*marker == 0xffda || *marker == 0xffd9)
      return make_error(Errc::bad_frame, "the JPEG has no frame header: save the image again");
    at += 2 + *length;
  }
}

/// The first directory of a TIFF 6.0 file: tag, type, count, value or offset.
class Directory {
 public:
  static Result<Directory> read(Bytes bytes, bool big_endian) {
    Directory d(bytes, big_endian);
    const auto at = d.in_.at(4, 4);
    const auto count = at ? d.in_.at(*at, 2) : std::nullopt;
    if (!count) return cut_short("directory");
    for (std::uint64_t i = 0; i < *count; ++i) {
      const std::uint64_t entry = *at + 2 + 12 * i;
      const auto tag = d.in_.at(entry, 2), type = d.in_.at(entry + 2, 2), n = d.in_.at(entry + 4, 4);
      if (!tag || !type || !n || !d.in_.at(entry + 8, 4)) return cut_short("directory");
      d.entries_.push_back({*tag, *type, *n, entry + 8});
    }
    return d;
  }
  /// Unsigned numbers of a tag (SHORT or LONG), at most `most`; empty where it has none or they are broken.
  std::vector<std::uint64_t> whole(std::uint64_t tag, std::uint64_t most) const {
    return values<std::uint64_t>(tag, most, [](std::uint64_t type) -> std::size_t {
      return type == 3 ? 2 : type == 4 ? 4 : 0;
    });
  }
  std::vector<double> real(std::uint64_t tag, std::uint64_t most) const {
    return values<double>(tag, most, [](std::uint64_t type) -> std::size_t { return type == 12 ? 8 : 0; });
  }

 private:
  struct Entry {
    std::uint64_t tag, type, count, value_at;
  };
  Directory(Bytes bytes, bool big_endian) : in_(bytes, big_endian) {}
  template <class T, class Width>
  std::vector<T> values(std::uint64_t tag, std::uint64_t most, const Width& width) const {
    std::vector<T> out;
    for (const auto& entry : entries_) {
      if (entry.tag != tag) continue;
      const std::size_t n = width(entry.type);
      if (n == 0 || entry.count > most) return {};
      const auto at = entry.count * n <= 4 ? std::optional(entry.value_at) : in_.at(entry.value_at, 4);
      for (std::uint64_t i = 0; at && i < entry.count; ++i) {
        const auto value = in_.at(*at + i * n, n);
        if (!value) return {};
        if constexpr (std::is_same_v<T, double>)
          out.push_back(std::bit_cast<double>(*value));
        else
          out.push_back(*value);
      }
      return out;
    }
    return out;
  }
  Numbers in_;
  std::vector<Entry> entries_;
};

bool finite(const std::vector<double>& values) {
  for (const double v : values)
    if (!std::isfinite(v)) return false;
  return true;
}

/// OGC GeoTIFF 1.1: the model's axes (ModelTransformation, or ModelPixelScale with one ModelTiepoint), and of
/// the GeoKeys the raster's type and the code of its system. A user-defined system (32767) has no code.
std::optional<GeoTags> geo_tags(const Directory& directory) {
  const auto keys = directory.whole(34735, 4 * 200);
  if (keys.size() < 4) return std::nullopt;
  std::optional<std::uint64_t> model, raster, geographic, projected;
  for (std::size_t i = 4; i + 3 < keys.size() && i < 4 * (keys[3] + 1); i += 4) {
    if (keys[i + 1] != 0) continue;  // its value is in another tag: a text or a double
    if (keys[i] == 1024) model = keys[i + 3];
    if (keys[i] == 1025) raster = keys[i + 3];
    if (keys[i] == 2048) geographic = keys[i + 3];
    if (keys[i] == 3072) projected = keys[i + 3];
  }
  GeoTags out;
  out.geographic = model == 2;
  const auto code = out.geographic ? geographic : projected;
  if (!code || *code < 1024 || *code >= 32767) return std::nullopt;
  out.epsg = static_cast<int>(*code);
  const auto matrix = directory.real(34264, 16), scale = directory.real(33550, 3),
             tie = directory.real(33922, 6);
  auto& m = out.map_from_pixel;
  if (matrix.size() == 16 && finite(matrix)) {
    m << matrix[0], matrix[1], matrix[3], matrix[4], matrix[5], matrix[7];
  } else if (scale.size() == 3 && tie.size() == 6 && finite(scale) && finite(tie)) {
    m << scale[0], 0, tie[3] - tie[0] * scale[0], 0, -scale[1], tie[4] + tie[1] * scale[1];
  } else {
    return std::nullopt;
  }
  if (raster == 2) m.col(2) -= 0.5 * (m.col(0) + m.col(1));  // PixelIsPoint: it names the pixels' middles
  if (m.leftCols<2>().determinant() == 0) return std::nullopt;
  return out;
}

Result<ImageHead> tiff_head(Bytes bytes, bool big_endian) {
  BOOST_OUTCOME_TRY(const auto directory, Directory::read(bytes, big_endian));
  const auto width = directory.whole(256, 1), height = directory.whole(257, 1);
  if (width.empty() || height.empty())
    return make_error(Errc::bad_frame, "the TIFF's first directory has no size: the file is broken");
  return ImageHead{ImageFormat::tiff, static_cast<std::int64_t>(width[0]),
                   static_cast<std::int64_t>(height[0]), geo_tags(directory)};
}

Result<ImageHead> head_of(Bytes bytes) {
  if (begins(bytes, k_png)) return png_head(bytes);
  if (begins(bytes, k_jpeg)) return jpeg_head(bytes);
  if (begins(bytes, k_tiff_little)) return tiff_head(bytes, false);
  if (begins(bytes, k_tiff_big)) return tiff_head(bytes, true);
  const char* what = begins(bytes, k_bigtiff_little) || begins(bytes, k_bigtiff_big)
                         ? "a BigTIFF, which is not accepted"
                         : "not a PNG, JPEG, TIFF, PDF or DXF";
  return make_error(
      Errc::unsupported,
      std::string("the file is ") + what +
          ": send the plan as PNG, JPEG, (Geo)TIFF, PDF or ASCII DXF; export a DWG to DXF, an SVG to PDF");
}

}  // namespace

Result<ImageHead> image_head(Bytes bytes) {
  BOOST_OUTCOME_TRY(const auto head, head_of(bytes));
  if (head.width_px <= 0 || head.height_px <= 0)
    return make_error(Errc::bad_frame, "the image has no pixels: the file is broken");
  if (head.width_px > k_max_image_side_px || head.height_px > k_max_image_side_px ||
      head.width_px * head.height_px > k_max_image_pixels)
    return make_error(Errc::invalid_argument, "the image is " + std::to_string(head.width_px) + " x " +
                                                  std::to_string(head.height_px) + " pixels (limit " +
                                                  std::to_string(k_max_image_side_px) + " a side, " +
                                                  std::to_string(k_max_image_pixels / 1'000'000) +
                                                  " million in all): scale it down, or send a single floor");
  return head;
}

}  // namespace anchord::floor_plan
