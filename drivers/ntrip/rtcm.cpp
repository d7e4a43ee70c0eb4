#include "drivers/ntrip/rtcm.hpp"

#include <cmath>
#include <cstddef>

#include "core/base/crc24q.hpp"

namespace anchord::ntrip {

namespace {

/// Unsigned field of `n` bits from bit `from`, most significant first.
std::uint64_t bits(std::string_view body, std::size_t from, std::size_t n) {
  std::uint64_t out = 0;
  for (std::size_t i = from; i < from + n; ++i)
    out = out << 1 | (static_cast<unsigned char>(body[i / 8]) >> (7 - i % 8) & 1u);
  return out;
}

/// Two's complement of 38 bits in steps of 0.1 mm.
double coordinate_m(std::string_view body, std::size_t from) {
  const std::uint64_t raw = bits(body, from, 38);
  const auto value = static_cast<std::int64_t>(raw) - ((raw >> 37 & 1u) != 0 ? std::int64_t{1} << 38 : 0);
  return static_cast<double>(value) * 1e-4;
}

}  // namespace

std::optional<BaseStation> base_station(std::string_view body) {
  if (body.size() < 19) return std::nullopt;
  const auto number = bits(body, 0, 12);
  if (number != 1005 && (number != 1006 || body.size() < 21)) return std::nullopt;
  BaseStation out;
  out.station = static_cast<int>(bits(body, 12, 12));
  out.ecef_m = {coordinate_m(body, 34), coordinate_m(body, 74), coordinate_m(body, 114)};
  if (number == 1006) out.antenna_height_m = static_cast<double>(bits(body, 152, 16)) * 1e-4;
  const double radius_m = std::hypot(out.ecef_m[0], out.ecef_m[1], out.ecef_m[2]);
  if (radius_m < 6.3e6 || radius_m > 6.4e6) return std::nullopt;
  return out;
}

int RtcmFrames::feed(std::string_view bytes) {
  whole_.clear();
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
    if (const auto told = base_station(frame.substr(3, length))) base_ = told;
    whole_.emplace_back(frame);
    ++good;
    at += whole;
  }
  held_.erase(0, at);
  return good;
}

}  // namespace anchord::ntrip
