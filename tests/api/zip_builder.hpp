#pragma once

#include <zlib.h>

#include <cstdint>
#include <string>
#include <vector>

namespace anchord::test {

/// Zip files byte by byte (APPNOTE 6.3, sections 4.3.7, 4.3.12 and 4.3.16), the wrong ones too: what a good
/// writer would never make.
class ZipBuilder {
 public:
  struct Entry {
    std::string name, content;
    bool deflate{false};
    std::uint32_t unix_mode{0100600};
    std::uint32_t said_bytes{0xFFFFFFFF};  ///< another size than it has
    std::uint16_t flags{0};
  };
  ZipBuilder& add(Entry entry) {
    entries_.push_back(std::move(entry));
    return *this;
  }
  ZipBuilder& add(std::string name, std::string content) {
    return add({std::move(name), std::move(content)});
  }

  std::string bytes() const {
    std::string out, directory;
    for (const auto& entry : entries_) {
      const std::string packed = entry.deflate ? deflated(entry.content) : entry.content;
      const auto sum = static_cast<std::uint32_t>(crc32(
          0, reinterpret_cast<const Bytef*>(entry.content.data()), static_cast<uInt>(entry.content.size())));
      const std::uint32_t size = entry.said_bytes != 0xFFFFFFFF
                                     ? entry.said_bytes
                                     : static_cast<std::uint32_t>(entry.content.size());
      std::string common = two(20) + two(entry.flags) + two(entry.deflate ? 8 : 0) + two(0) + two(0x2821) +
                           four(sum) + four(static_cast<std::uint32_t>(packed.size())) + four(size) +
                           two(static_cast<std::uint16_t>(entry.name.size())) + two(0);
      directory += "PK\x01\x02" + two(0x0314) + common + two(0) + two(0) + two(0) +
                   four(entry.unix_mode << 16) + four(static_cast<std::uint32_t>(out.size())) + entry.name;
      out += "PK\x03\x04" + common + entry.name + packed;
    }
    const auto n = static_cast<std::uint16_t>(entries_.size());
    return out + directory + "PK\x05\x06" + two(0) + two(0) + two(n) + two(n) +
           four(static_cast<std::uint32_t>(directory.size())) + four(static_cast<std::uint32_t>(out.size())) +
           two(0);
  }

 private:
  static std::string two(std::uint16_t v) { return {static_cast<char>(v & 0xFF), static_cast<char>(v >> 8)}; }
  static std::string four(std::uint32_t v) {
    return two(static_cast<std::uint16_t>(v & 0xFFFF)) + two(static_cast<std::uint16_t>(v >> 16));
  }
  static std::string deflated(const std::string& content) {
    z_stream z{};
    deflateInit2(&z, 6, Z_DEFLATED, -15, 8, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&z, content.size()), '\0');
    z.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(content.data()));
    z.avail_in = static_cast<uInt>(content.size());
    z.next_out = reinterpret_cast<Bytef*>(out.data());
    z.avail_out = static_cast<uInt>(out.size());
    deflate(&z, Z_FINISH);
    out.resize(z.total_out);
    deflateEnd(&z);
    return out;
  }
  std::vector<Entry> entries_;
};

}  // namespace anchord::test
