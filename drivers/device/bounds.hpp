#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "core/base/ids.hpp"
#include "core/types/range.hpp"

namespace anchord::device {

/// Bytes of a device that make no frame are recorded up to so many, and then a sample of them: noise must not
/// fill the disk of the flights. In a flight so many are hours of any serial port: a receiver whose format is
/// set wrong is decoded from them afterwards. The bytes that make a frame again are recorded, and all after
/// them.
struct NoiseLimits {
  std::uint64_t in_a_flight_bytes = 256u << 20, else_bytes = 1u << 20;  ///< since the last frame
  std::uint64_t sample_bytes = 64u << 10;                               ///< each minute
};

/// What of a device's noise is recorded. A new connection of it is no reason to begin again.
class Noise {
 public:
  void heard() { *this = {}; }  ///< a good frame
  /// Whether bytes that came are recorded before anybody parses them.
  bool is_worth_recording(std::uint64_t bytes, std::int64_t steady_ns, bool in_a_flight,
                          const NoiseLimits& limits);
  bool skipped() const { return skipped_; }  ///< some of them were not recorded

 private:
  std::uint64_t bytes_{0}, sampled_{0};
  std::int64_t sample_since_ns_{0};
  bool skipped_{false};
};

/// The ids a device has sent, as far as a flight in the air follows so many (core/types/live_limits.hpp).
class SentIds {
 public:
  void note(const Range& range);
  /// What is wrong and what to do; empty: nothing.
  std::string trouble() const;

 private:
  std::set<NetworkId> tags_, anchors_;
};

}  // namespace anchord::device
