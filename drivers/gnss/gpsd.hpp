#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::gpsd {

/// Reports of a gpsd (protocol 3) and its answers to ?POLL, one JSON object per line. Several TPV of one time
/// are merged; published with the GST of that time or when the next time begins. Each of a gpsd's devices is
/// its own receiver: their reports are never mixed. eph and its sisters are not used: with NMEA receivers
/// they are HDOP times a constant, metres where RTK has centimetres. Not thread-safe.
class Assembler {
 public:
  /// errors: bad_frame (not JSON, not an object, value out of its domain, one device more than the 16 that
  /// are told apart), unsupported (a position without a time). Unknown classes and fields are fine.
  Result<void> line(std::string_view text, Epochs& out);
  void finish(Epochs& out);

 private:
  struct Device {
    std::optional<Epoch> current;
    std::optional<UtcTime> published;
    std::optional<int> satellites;
    std::optional<double> hdop;

    void merge(const Epoch& report, Epochs& out);
    void publish(Epochs& out);
  };
  struct Report;
  Result<void> take(const Report& report, Epochs& out);
  /// Whose report it is; one without a name is of the device named last, or of the first one to be named.
  Result<Device*> device_of(std::optional<std::string> path);

  std::map<std::string, Device, std::less<>> devices_;  ///< by path
  std::string last_;
};

}  // namespace anchord::gnss::gpsd
