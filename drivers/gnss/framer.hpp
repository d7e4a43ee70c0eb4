#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss {

/// One complete frame whose checksum, where the format has one, is right.
struct Frame {
  Protocol protocol{Protocol::nmea};
  std::string_view bytes;  ///< nmea: between $ and *; ubx, erb: whole frame; llh, gpsd: line without its end
  std::uint64_t offset{};  ///< of its first byte in the stream
};

/// Longest frames believed; of NMEA, a receiver's own $PUBX,03 of 40 satellites is 1000 bytes. A longer one
/// is taken for noise and the search goes on at its second byte.
inline constexpr std::size_t k_max_nmea = 1024, k_max_ubx_payload = 8192, k_max_erb_payload = 645,
                             k_max_llh = 1024, k_max_gpsd = 16'384;

/// Cuts a byte stream into frames; all formats share one buffer and the earliest complete valid frame wins.
///
/// A frame that turns out wrong costs its first byte only: what follows inside it is searched again, so noise
/// that looks like a header swallows nothing. Memory: at most one longest frame and the chunk being fed. Text
/// lines without a checksum (LLH) count only when their end was seen. RTCM 3 (corrections on the same wire)
/// is recognised where every format is looked for, and counted as such.
class Framer {
 public:
  using Sink = std::function<void(const Frame&)>;
  /// `only`: look for this format alone; absent: for all.
  Framer(std::optional<Protocol> only, Skips& skips) : only_(only), skips_(skips) {}

  void feed(std::string_view bytes, const Sink& sink);
  /// The stream has ended: what waits for its end will not get it.
  void finish(const Sink& sink);

 private:
  struct Step {
    enum class Kind : std::uint8_t { need_more, frame, skip } kind{Kind::need_more};
    std::size_t length{0};
    Frame frame{};
    const char* reason{nullptr};
  };
  void drain(const Sink& sink, bool final);
  Step step(std::string_view rest, bool final) const;
  Step ubx(std::string_view rest, bool final) const;
  Step erb(std::string_view rest, bool final) const;
  Step rtcm3(std::string_view rest, bool final) const;
  Step text(std::string_view rest, bool final) const;
  Step nmea(std::string_view rest, bool final) const;
  Step line(std::string_view rest, bool final, Protocol protocol, std::size_t limit) const;
  bool looks_for(Protocol protocol) const { return !only_ || *only_ == protocol; }

  std::optional<Protocol> only_;
  Skips& skips_;
  std::string buffer_;
  std::uint64_t offset_{0};  ///< of buffer_[0]
  bool line_start_{true};
};

}  // namespace anchord::gnss
