#pragma once

#include <optional>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::gpsd {

/// Reports of a gpsd (protocol 3), one JSON object per line. Several TPV of one time are merged; published
/// with the GST of that time or when the next time begins. eph and its sisters are not used: with NMEA
/// receivers they are HDOP times a constant, metres where RTK has centimetres. Not thread-safe.
class Assembler {
 public:
  /// errors: bad_frame (not JSON, not an object, value out of its domain). Unknown classes and fields are
  /// fine.
  Result<void> line(std::string_view text, Epochs& out);
  void finish(Epochs& out) { publish(out); }

 private:
  void merge(const Epoch& report, Epochs& out);
  void publish(Epochs& out);

  std::optional<Epoch> current_;
  std::optional<UtcTime> published_;
  std::optional<int> satellites_;
  std::optional<double> hdop_;
};

}  // namespace anchord::gnss::gpsd
