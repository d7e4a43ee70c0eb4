#pragma once

#include <optional>
#include <string_view>

#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::llh {

/// RTKLIB solution text, line by line. Header lines may come at any time or never; until one says otherwise
/// time is UTC (as Reach streams it) and height ellipsoidal. Not thread-safe.
class Decoder {
 public:
  /// One line without its end. An epoch, nothing for headers and blank lines, or an error: bad_frame (too few
  /// columns, not a number, out of its domain), unsupported (ECEF and baseline forms: no geodetic position in
  /// them).
  Result<std::optional<Epoch>> line(std::string_view text);

 private:
  void header(std::string_view text);
  enum class TimeSystem : std::uint8_t { utc, gpst, jst } system_{TimeSystem::utc};
  bool geodetic_height_{false};  ///< above the geoid, "geodetic" in the header
  bool other_form_{false};
};

}  // namespace anchord::gnss::llh
