#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace anchord::ntrip {

/// CRC-24Q of RTCM 3 (polynomial 0x1864CFB, start 0).
std::uint32_t crc24q(std::string_view bytes);

/// Counts whole RTCM 3 frames in a stream of corrections. The bytes themselves go on as they came: it is the
/// rover that decodes them. Holds at most one frame.
class RtcmCounter {
 public:
  /// Good frames that end in these bytes.
  int feed(std::string_view bytes);
  std::uint64_t skipped() const { return skipped_; }  ///< bytes that belong to no good frame
  int newest_message() const { return newest_; }      ///< number of the last one, e.g. 1077; 0: none yet

 private:
  std::string held_;
  std::uint64_t skipped_{0};
  int newest_{0};
};

}  // namespace anchord::ntrip
