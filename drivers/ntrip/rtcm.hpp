#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/types/base_station.hpp"

namespace anchord::ntrip {

/// Body (without header and checksum) of message 1005 or 1006; absent for another one, a short one, or a
/// place that is not near the earth's surface (a base not yet told its own sends zeros). RTCM 10403.3,
/// tables 3.5-6, 3.5-7.
std::optional<BaseStation> base_station(std::string_view body);

/// Finds whole RTCM 3 frames in a stream of corrections; what belongs to none with a right checksum is
/// counted and goes no further. Holds at most one frame.
class RtcmFrames {
 public:
  /// Good frames that end in these bytes; whole() has them.
  int feed(std::string_view bytes);
  const std::vector<std::string>& whole() const { return whole_; }  ///< of the last feed(), in their order
  std::uint64_t skipped() const { return skipped_; }                ///< bytes that belong to no good frame
  const std::optional<BaseStation>& base() const { return base_; }  ///< the newest it told of
  int newest_message() const { return newest_; }  ///< number of the last one, e.g. 1077; 0: none yet

 private:
  std::string held_;
  std::vector<std::string> whole_;
  std::uint64_t skipped_{0};
  int newest_{0};
  std::optional<BaseStation> base_{};
};

}  // namespace anchord::ntrip
