#include "core/base/time.hpp"

#include <chrono>
#include <cmath>
#include <cstdio>

#include "core/base/text.hpp"

namespace anchord {

UtcTime UtcTime::from_seconds(double s) { return {static_cast<std::int64_t>(std::llround(s * 1e9))}; }

std::string to_rfc3339(UtcTime t) {
  using namespace std::chrono;
  const sys_time<nanoseconds> instant{nanoseconds{t.ns}};
  const auto day = floor<days>(instant);
  const year_month_day date{day};
  const hh_mm_ss clock{floor<microseconds>(instant - day)};
  char text[64];
  std::snprintf(text, sizeof text, "%04d-%02u-%02uT%02d:%02d:%02d.%06dZ", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                static_cast<int>(clock.hours().count()), static_cast<int>(clock.minutes().count()),
                static_cast<int>(clock.seconds().count()), static_cast<int>(clock.subseconds().count()));
  return text;
}

Result<UtcTime> parse_rfc3339(std::string_view text) {
  using namespace std::chrono;
  const auto bad = [&] {
    return make_error(Errc::invalid_argument,
                      "'" + to_utf8(text, 40) + "' is not a UTC time like 2026-05-04T10:11:12.345678Z");
  };
  const auto digits = [&](std::size_t at, std::size_t n) -> int {
    int value = 0;
    for (std::size_t i = at; i < at + n; ++i) {
      if (text[i] < '0' || text[i] > '9') return -1;
      value = value * 10 + (text[i] - '0');
    }
    return value;
  };
  if (text.size() < 20 || text.size() > 30 || text.back() != 'Z' || text[4] != '-' || text[7] != '-' ||
      (text[10] != 'T' && text[10] != 't') || text[13] != ':' || text[16] != ':') {
    return bad();
  }
  const int y = digits(0, 4), mo = digits(5, 2), d = digits(8, 2);
  const int h = digits(11, 2), mi = digits(14, 2), s = digits(17, 2);
  if (y < 0 || mo < 0 || d < 0 || h < 0 || h > 23 || mi < 0 || mi > 59 || s < 0 || s > 59) return bad();
  const year_month_day date{year{y}, month{static_cast<unsigned>(mo)}, day{static_cast<unsigned>(d)}};
  if (!date.ok()) return bad();
  // 64 bits of nanoseconds hold 1677-09-21 to 2262-04-11; whole years, so that no fraction runs over either.
  if (y < 1678 || y > 2261) return bad();
  std::int64_t fraction_ns = 0;
  if (text.size() > 20) {
    const std::size_t n = text.size() - 21;
    if (text[19] != '.' || n == 0 || n > 9) return bad();
    const int fraction = digits(20, n);
    if (fraction < 0) return bad();
    fraction_ns = fraction;
    for (std::size_t i = n; i < 9; ++i) fraction_ns *= 10;
  }
  const auto whole = sys_days{date} + hours{h} + minutes{mi} + seconds{s};
  const auto ns = duration_cast<nanoseconds>(whole.time_since_epoch()).count();
  return UtcTime{ns + fraction_ns};
}

UtcTime SystemClock::now() const {
  using namespace std::chrono;
  return {duration_cast<nanoseconds>(system_clock::now().time_since_epoch()).count()};
}

}  // namespace anchord
