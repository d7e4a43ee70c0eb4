#include "drivers/ntrip/rtcm.hpp"

namespace anchord::ntrip {

std::uint32_t crc24q(std::string_view bytes) {
  std::uint32_t crc = 0;
  for (const char c : bytes) {
    crc ^= static_cast<std::uint32_t>(static_cast<unsigned char>(c)) << 16;
    for (int i = 0; i < 8; ++i) {
      crc <<= 1;
      if (crc & 0x1000000) crc ^= 0x1864cfb;
    }
  }
  return crc & 0xffffff;
}

int RtcmCounter::feed(std::string_view bytes) {
  held_ += bytes;
  int good = 0;
  std::size_t at = 0;
  const auto byte = [&](std::size_t i) {
    return static_cast<unsigned>(static_cast<unsigned char>(held_[i]));
  };
  while (at < held_.size()) {
    // Preamble, six reserved zero bits, ten bits of length.
    if (byte(at) != 0xd3 || (at + 1 < held_.size() && (byte(at + 1) & 0xfc) != 0)) {
      ++at;
      ++skipped_;
      continue;
    }
    if (held_.size() - at < 3) break;
    const std::size_t length = (byte(at + 1) & 3) << 8 | byte(at + 2), whole = length + 6;
    if (held_.size() - at < whole) break;
    const std::string_view frame(held_.data() + at, whole);
    const std::uint32_t sum = byte(at + whole - 3) << 16 | byte(at + whole - 2) << 8 | byte(at + whole - 1);
    if (crc24q(frame.substr(0, whole - 3)) != sum) {
      ++at;  // a false preamble must not swallow what follows
      ++skipped_;
      continue;
    }
    if (length >= 2) newest_ = static_cast<int>(byte(at + 3) << 4 | byte(at + 4) >> 4);
    ++good;
    at += whole;
  }
  held_.erase(0, at);
  return good;
}

}  // namespace anchord::ntrip
