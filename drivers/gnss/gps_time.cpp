#include "drivers/gnss/gps_time.hpp"

#include <array>

namespace anchord::gnss {
namespace {

constexpr std::int64_t k_gps_epoch_s = 315'964'800;  // 1980-01-06T00:00:00Z

struct Leap {
  int year, month;
  int offset_s;
};
// From the first day of that month on (IERS Bulletin C; GPS minus UTC).
constexpr std::array k_leaps{Leap{1981, 7, 1},  Leap{1982, 7, 2},  Leap{1983, 7, 3},  Leap{1985, 7, 4},
                             Leap{1988, 1, 5},  Leap{1990, 1, 6},  Leap{1991, 1, 7},  Leap{1992, 7, 8},
                             Leap{1993, 7, 9},  Leap{1994, 7, 10}, Leap{1996, 1, 11}, Leap{1997, 7, 12},
                             Leap{1999, 1, 13}, Leap{2006, 1, 14}, Leap{2009, 1, 15}, Leap{2012, 7, 16},
                             Leap{2015, 7, 17}, Leap{2017, 1, 18}};

}  // namespace

std::optional<std::int64_t> days_from_civil(int year, int month, int day) {
  if (year < 1980 || year > 2100 || month < 1 || month > 12 || day < 1) return std::nullopt;
  constexpr std::array k_days{31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  const bool leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
  if (day > k_days[static_cast<std::size_t>(month - 1)] + (leap && month == 2 ? 1 : 0)) return std::nullopt;
  // March-based year, so that the leap day is the last one.
  const int y = month <= 2 ? year - 1 : year;
  const int era = y / 400, of_era = y - era * 400;
  const int of_year = (153 * (month + (month > 2 ? -3 : 9)) + 2) / 5 + day - 1;
  return static_cast<std::int64_t>(era) * 146'097 + of_era * 365 + of_era / 4 - of_era / 100 + of_year -
         719'468;
}

std::optional<std::int64_t> time_of_day_ns(int hour, int minute, int second, std::int64_t fraction_ns) {
  if (hour < 0 || hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 60) return std::nullopt;
  return (hour * 3600 + minute * 60 + second) * k_second_ns + fraction_ns;
}

int gps_minus_utc_s(std::int64_t gps_ns) {
  int offset = 0;
  for (const auto& leap : k_leaps) {
    const auto from_s = days_from_civil(leap.year, leap.month, 1).value_or(0) * 86'400 + leap.offset_s;
    if (gps_ns >= from_s * k_second_ns) offset = leap.offset_s;
  }
  return offset;
}

UtcTime utc_from_gps(std::int64_t gps_ns) { return {gps_ns - gps_minus_utc_s(gps_ns) * k_second_ns}; }

std::int64_t gps_week_ns(int week, std::int64_t ns_of_week) {
  const std::int64_t full_week = week < 1024 ? week + 2048 : week;
  return (k_gps_epoch_s + full_week * 604'800) * k_second_ns + ns_of_week;
}

UtcTime utc_from_gps_week(int week, std::int64_t ns_of_week) {
  return utc_from_gps(gps_week_ns(week, ns_of_week));
}

UtcTime nearest_time_of_day(UtcTime reference, std::int64_t tod_ns) {
  std::int64_t day = reference.ns / k_day_ns;
  if (reference.ns < 0 && reference.ns % k_day_ns != 0) --day;
  std::int64_t ns = day * k_day_ns + tod_ns;
  if (ns - reference.ns > k_day_ns / 2) ns -= k_day_ns;
  if (reference.ns - ns > k_day_ns / 2) ns += k_day_ns;
  return {ns};
}

}  // namespace anchord::gnss
