#pragma once

#include <bit>
#include <cstdint>
#include <string>
#include <vector>

/// Files of pictures made by hand, byte by byte.
namespace anchord::floor_plan {

inline std::string big(std::uint64_t value, int n) {
  std::string out;
  while (n-- > 0) out += static_cast<char>(value >> 8 * n & 0xff);
  return out;
}
inline std::string little(std::uint64_t value, int n) {
  std::string out;
  for (int i = 0; i < n; ++i) out += static_cast<char>(value >> 8 * i & 0xff);
  return out;
}

/// TIFF 6.0 by hand: 4 x 3 grey pixels, uncompressed, with the tags of GeoTIFF 1.1.
inline std::string tiff(bool big_endian, bool point, int code_key = 3072, int code = 25831) {
  const auto number = [&](std::uint64_t v, int n) { return big_endian ? big(v, n) : little(v, n); };
  const auto real = [&](double v) { return number(std::bit_cast<std::uint64_t>(v), 8); };
  const std::string pixels("\x00\x40\x80\xc0\x10\x50\x90\xd0\x20\x60\xa0\xe0", 12);
  std::string data;  // behind the head of 8 bytes
  data += pixels;
  const auto scale_at = 8 + data.size();
  data += real(0.5) + real(0.25) + real(0);
  const auto tie_at = 8 + data.size();
  data += real(0) + real(0) + real(0) + real(500000) + real(5600000) + real(0);
  const auto keys_at = 8 + data.size();
  const int model = code_key == 2048 ? 2 : 1;
  for (const int key : {1, 1, 0, 3, 1024, 0, 1, model, 1025, 0, 1, point ? 2 : 1, code_key, 0, 1, code})
    data += number(static_cast<std::uint64_t>(key), 2);
  const auto directory_at = 8 + data.size();
  struct Tag {
    int tag, type;
    std::uint64_t count, value;
  };
  const std::vector<Tag> tags{{256, 3, 1, 4},           {257, 3, 1, 3},         {258, 3, 1, 8},
                              {259, 3, 1, 1},           {262, 3, 1, 1},         {273, 4, 1, 8},
                              {277, 3, 1, 1},           {278, 3, 1, 3},         {279, 4, 1, 12},
                              {33550, 12, 3, scale_at}, {33922, 12, 6, tie_at}, {34735, 3, 16, keys_at}};
  data += number(tags.size(), 2);
  for (const auto& tag : tags) {
    data += number(static_cast<std::uint64_t>(tag.tag), 2) + number(static_cast<std::uint64_t>(tag.type), 2) +
            number(tag.count, 4);
    data += tag.type == 3 && tag.count == 1 ? number(tag.value, 2) + number(0, 2) : number(tag.value, 4);
  }
  data += number(0, 4);
  return (big_endian ? std::string("MM\0\x2a", 4) : std::string("II\x2a\0", 4)) + number(directory_at, 4) +
         data;
}

/// A progressive grey JPEG of so many pixels a side (ITU T.81), every coefficient zero: one scan of DC values
/// with a bit for each block, and scans of the others in runs of 16384 blocks, each a pass over the picture.
inline std::string jpeg_of_scans(std::uint32_t side, int ac_scans) {
  const auto segment = [](int marker, const std::string& body) {
    return std::string("\xff") + static_cast<char>(marker) + big(body.size() + 2, 2) + body;
  };
  const auto code_table = [&](char which, char symbol) {  // one code, of one bit
    return segment(0xc4, std::string(1, which) + '\1' + std::string(15, '\0') + symbol);
  };
  const std::size_t blocks = std::size_t{side / 8} * (side / 8), runs = (blocks + 16383) / 16384;
  std::string out = "\xff\xd8" + segment(0xdb, '\0' + std::string(64, '\1'));
  out += segment(0xc2, '\x08' + big(side, 2) + big(side, 2) + std::string("\1\1\x11\0", 4));
  out += code_table('\0', '\0') + code_table('\x10', '\xe0');
  out += segment(0xda, std::string("\1\1\0\0\0\0", 6)) + std::string((blocks + 7) / 8, '\0');
  const auto scan = segment(0xda, std::string("\1\1\0\1\x3f\0", 6)) + std::string((15 * runs + 7) / 8, '\0');
  while (ac_scans-- > 0) out += scan;
  return out + "\xff\xd9";
}

/// The head of a PNG of this size, and nothing behind it.
inline std::string png_head(std::uint32_t width, std::uint32_t height) {
  return std::string("\x89PNG\r\n\x1a\n", 8) + big(13, 4) + "IHDR" + big(width, 4) + big(height, 4) +
         std::string(9, '\0');
}

}  // namespace anchord::floor_plan
