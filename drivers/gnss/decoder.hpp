#pragma once

#include <array>
#include <optional>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"
#include "drivers/gnss/erb.hpp"
#include "drivers/gnss/framer.hpp"
#include "drivers/gnss/gpsd.hpp"
#include "drivers/gnss/llh.hpp"
#include "drivers/gnss/nmea.hpp"
#include "drivers/gnss/ubx.hpp"

namespace anchord::gnss {

struct DecoderOptions {
  std::optional<Protocol> only{};  ///< absent: every format the stream holds
  nmea::GstOrder gst_order{nmea::GstOrder::larger_for_both};
  std::optional<UtcTime> reference{};  ///< some instant of the stream, for NMEA that never says the date
  llh::TimeSystem llh_time{llh::TimeSystem::utc};  ///< of LLH lines that no header came before
};

/// Bytes of a receiver in, epochs out, whatever it speaks and however the bytes are cut. No clock, no port,
/// bounded memory, never throws on any input. Not thread-safe.
class Decoder {
 public:
  explicit Decoder(const DecoderOptions& options = {});

  void feed(std::string_view bytes, Epochs& out);
  /// The stream has ended: publishes what was being collected.
  void finish(Epochs& out);

  /// The wire has been quiet for longer than receivers pause inside an epoch: publishes what is complete
  /// enough now instead of when the next epoch begins. What follows of the same time makes no second epoch of
  /// its own unless it repeats a position; callers drop those by their time.
  void quiet(Epochs& out);
  /// Some instant of the stream, for NMEA that never says the date.
  void set_reference(UtcTime time) { nmea_.set_reference(time); }

  const Skips& skips() const { return skips_; }
  /// Good frames of a format so far; of those without a checksum, the lines that could be read.
  std::uint64_t frames(Protocol protocol) const { return frames_[static_cast<std::size_t>(protocol)]; }
  /// LLH epochs whose time is of DecoderOptions::llh_time, because no header named another.
  std::uint64_t llh_time_assumed() const { return llh_.time_assumed(); }

 private:
  void take(const Frame& frame, Epochs& out);
  void take_nmea(const Frame& frame, Epochs& out);
  void take_llh(const Frame& frame, Epochs& out);
  void take_gpsd(const Frame& frame, Epochs& out);
  void count_without_pvt(std::uint64_t offset);
  void skip(std::string_view reason, const Frame& frame, const Error& why);
  void good(const Frame& frame) { ++frames_[static_cast<std::size_t>(frame.protocol)]; }
  template <class Parsed, class Assembler>
  void take_binary(const Parsed& parsed, Assembler& assembler, const Frame& frame, const char* reason,
                   Epochs& out);

  Skips skips_;
  Framer framer_;
  std::array<std::uint64_t, 5> frames_{};
  std::uint64_t without_pvt_{0}, fed_{0};
  nmea::Assembler nmea_;
  ubx::Assembler ubx_;
  erb::Assembler erb_;
  llh::Decoder llh_;
  gpsd::Assembler gpsd_;
};

}  // namespace anchord::gnss
