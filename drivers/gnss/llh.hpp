#pragma once

#include <cstdint>
#include <optional>
#include <string_view>

#include "core/base/enum_table.hpp"
#include "core/base/result.hpp"
#include "drivers/gnss/epoch.hpp"

namespace anchord::gnss::llh {

enum class TimeSystem : std::uint8_t { utc, gpst, jst };
inline constexpr auto k_time_system_words =
    enum_table<TimeSystem>({{"utc", TimeSystem::utc}, {"gpst", TimeSystem::gpst}, {"jst", TimeSystem::jst}});

/// RTKLIB solution text, line by line. Header lines may come at any time or never; until one says otherwise
/// a date and time are of the system given here, a week and its seconds GPS time, and height is ellipsoidal.
/// Not thread-safe.
class Decoder {
 public:
  /// `unnamed`: UTC is what Reach streams without a header; files of RTKLIB itself are GPST by default.
  explicit Decoder(TimeSystem unnamed = TimeSystem::utc) : unnamed_(unnamed) {}
  /// One line without its end. An epoch, nothing for headers and blank lines, or an error: bad_frame (too few
  /// columns, not a number, out of its domain), unsupported (ECEF and baseline forms, Tokyo datum: no WGS84
  /// position in them).
  Result<std::optional<Epoch>> line(std::string_view text);
  /// Epochs whose time is of the unnamed system, because no header had said.
  std::uint64_t time_assumed() const { return time_assumed_; }

 private:
  void header(std::string_view text);
  Result<UtcTime> time_of(std::string_view first, std::string_view second);
  TimeSystem unnamed_;
  std::optional<TimeSystem> system_{};  ///< absent: no header yet
  bool geodetic_height_{false};         ///< above the geoid, "geodetic" in the header
  bool column_header_{false}, other_form_{false}, other_datum_{false};
  std::uint64_t time_assumed_{0};
};

}  // namespace anchord::gnss::llh
