#pragma once

#include <compare>
#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/result.hpp"

namespace anchord {

/// An instant, nanoseconds since 1970-01-01T00:00:00Z, without leap seconds. The wire carries microseconds.
struct UtcTime {
  std::int64_t ns{};
  auto operator<=>(const UtcTime&) const = default;
  static constexpr UtcTime from_us(std::int64_t us) { return {us * 1000}; }
  static UtcTime from_seconds(double s);
  constexpr std::int64_t us() const { return ns / 1000; }
  constexpr double seconds() const { return static_cast<double>(ns) * 1e-9; }
};

/// b - a in seconds, exact before the conversion to double.
constexpr double seconds_between(UtcTime a, UtcTime b) { return static_cast<double>(b.ns - a.ns) * 1e-9; }

/// "2026-05-04T10:11:12.345678Z" (RFC 3339, UTC, microseconds).
std::string to_rfc3339(UtcTime t);
Result<UtcTime> parse_rfc3339(std::string_view text);

/// Where time comes from: the system in the server, the recording in a replay, the test in a test.
class Clock {
 public:
  virtual ~Clock() = default;
  virtual UtcTime now() const = 0;
};

class SystemClock final : public Clock {
 public:
  UtcTime now() const override;
};

}  // namespace anchord
