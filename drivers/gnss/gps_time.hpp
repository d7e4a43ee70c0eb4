#pragma once

#include <cstdint>
#include <optional>

#include "core/base/time.hpp"

namespace anchord::gnss {

inline constexpr std::int64_t k_second_ns = 1'000'000'000;
inline constexpr std::int64_t k_day_ns = 86'400 * k_second_ns;

/// Week of 2100-01-01: later ones are noise (and beyond 2262 too much for nanoseconds in 64 bits).
inline constexpr int k_last_gps_week = 6260;

/// Days since 1970-01-01 of a civil date; nothing for dates that do not exist or lie outside 1980..2100.
std::optional<std::int64_t> days_from_civil(int year, int month, int day);

/// Nanoseconds of the day; second 60 (leap second) allowed, it becomes the next minute as in POSIX time.
std::optional<std::int64_t> time_of_day_ns(int hour, int minute, int second, std::int64_t fraction_ns);

/// GPS minus UTC at an instant given in GPS time (nanoseconds since 1970-01-01 as if GPS time were UTC).
/// Table of IERS Bulletin C; 18 s since 2017-01-01, none announced since.
int gps_minus_utc_s(std::int64_t gps_ns);

/// GPS week and nanoseconds of week to UTC. A week below 1024 is a ten-bit week: no RTK receiver of ours ran
/// before the rollover of 2019-04-07 (week 2048), so it is counted from there.
UtcTime utc_from_gps_week(int week, std::int64_t ns_of_week);
/// The same instant in GPS time: nanoseconds since 1970-01-01 as if GPS time were UTC.
std::int64_t gps_week_ns(int week, std::int64_t ns_of_week);
UtcTime utc_from_gps(std::int64_t gps_ns);

/// The instant with this time of day that is nearest to the reference: moves a day at midnight.
UtcTime nearest_time_of_day(UtcTime reference, std::int64_t tod_ns);

}  // namespace anchord::gnss
