#include "api/formats/foreign_values.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <chrono>
#include <cmath>
#include <set>

#include "api/formats/flight_json.hpp"
#include "api/formats/foreign_columns.hpp"

namespace anchord::api {
namespace {

/// Seconds by which GPS was ahead of UTC, from these days on (IERS Bulletin C).
struct LeapSeconds {
  std::int64_t since_s;  ///< 1970 UTC
  std::int64_t ahead_s;
};
constexpr std::array k_leap_seconds{LeapSeconds{1483228800, 18}, LeapSeconds{1435708800, 17},
                                    LeapSeconds{1341100800, 16}, LeapSeconds{1230768000, 15},
                                    LeapSeconds{1136073600, 14}};
constexpr double k_gps_epoch_us = 315964800e6;
/// Some hours or days count from the beginning of the flight; decades are since 1970, or since 1980.
constexpr double k_flight_us = 3e14;
constexpr double k_most_us = 9e18 / 1000;

std::int64_t leap_us(double us) {
  for (const auto& leap : k_leap_seconds) {
    if (us >= static_cast<double>(leap.since_s) * 1e6) return leap.ahead_s * 1'000'000;
  }
  return 0;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }
bool has_colon_or_slash(std::string_view text) { return text.find_first_of(":/") != std::string_view::npos; }

/// Takes a text apart from its front; false from the first part on that is not there.
class Scanner {
 public:
  explicit Scanner(std::string_view text) : rest_(text) {}
  bool number(int& value, std::size_t least, std::size_t most) {
    std::size_t n = 0;
    value = 0;
    while (n < most && n < rest_.size() && is_digit(rest_[n])) value = value * 10 + (rest_[n++] - '0');
    rest_.remove_prefix(n);
    return n >= least;
  }
  bool any(std::string_view marks) {
    if (rest_.empty() || marks.find(rest_.front()) == std::string_view::npos) return false;
    rest_.remove_prefix(1);
    return true;
  }
  std::string_view digits() {
    std::size_t n = 0;
    while (n < rest_.size() && is_digit(rest_[n])) ++n;
    const auto out = rest_.substr(0, n);
    rest_.remove_prefix(n);
    return out;
  }
  std::string_view rest() const { return rest_; }

 private:
  std::string_view rest_;
};

struct Zone {
  std::int64_t ahead_min{0};
  bool gps{false}, named{false};
};
std::optional<Zone> zone_of(std::string_view text) {
  std::string upper;
  for (const char c : text) upper += c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c;
  if (upper.empty()) return Zone{};
  if (upper == "Z" || upper == "UTC" || upper == "GMT") return Zone{0, false, true};
  if (upper == "GPST") return Zone{0, true, true};
  Scanner scan(upper);
  int hours = 0, minutes = 0;
  const bool behind = upper.front() == '-';
  if (!scan.any("+-") || !scan.number(hours, 2, 2)) return std::nullopt;
  scan.any(":");
  if (!scan.number(minutes, 2, 2) || !scan.rest().empty()) return std::nullopt;
  return Zone{(behind ? -1 : 1) * (60 * hours + minutes), false, true};
}

/// A date that names no zone is of `scale`, never of this computer's own zone.
std::optional<std::int64_t> date_us(std::string_view text, TimeScale scale) {
  Scanner scan(text);
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  if (!scan.number(year, 4, 4) || !scan.any("-/.") || !scan.number(month, 1, 2) || !scan.any("-/.") ||
      !scan.number(day, 1, 2) || !scan.any("Tt "))
    return std::nullopt;
  while (scan.any("Tt ")) {
  }
  if (!scan.number(hour, 1, 2) || !scan.any(":") || !scan.number(minute, 2, 2) || !scan.any(":") ||
      !scan.number(second, 2, 2))
    return std::nullopt;
  std::int64_t fraction_us = 0;
  if (scan.any(".,")) {
    const auto digits = scan.digits();
    if (digits.empty()) return std::nullopt;
    double value = 0;
    const std::string number = "0." + std::string(digits);
    std::from_chars(number.data(), number.data() + number.size(), value);
    fraction_us = std::llround(value * 1e6);
  }
  while (scan.any(" ")) {
  }
  const auto zone = zone_of(scan.rest());
  const std::chrono::year_month_day date{std::chrono::year(year),
                                         std::chrono::month(static_cast<unsigned>(month)),
                                         std::chrono::day(static_cast<unsigned>(day))};
  if (!zone || !date.ok() || hour > 23 || minute > 59 || second > 60) return std::nullopt;
  const std::int64_t days = std::chrono::sys_days(date).time_since_epoch().count();
  const std::int64_t us =
      (days * 86400 + hour * 3600 + minute * 60 + second - zone->ahead_min * 60) * 1'000'000 + fraction_us;
  const bool gps = zone->gps || (scale == TimeScale::gps && !zone->named);
  return gps ? us - leap_us(static_cast<double>(us)) : us;
}

/// "2417 123456.789": week of GPS and its seconds.
std::optional<std::int64_t> week_us(std::string_view cell) {
  const auto blank = cell.find(' ');
  if (blank == std::string_view::npos || blank < 3 || blank > 4) return std::nullopt;
  auto of_week = cell.substr(blank);
  while (of_week.starts_with(' ')) of_week.remove_prefix(1);
  int week = 0;
  double seconds = 0;
  const auto w = std::from_chars(cell.data(), cell.data() + blank, week);
  const auto s =
      std::from_chars(of_week.data(), of_week.data() + of_week.size(), seconds, std::chars_format::fixed);
  if (of_week.empty() || !is_digit(of_week.front()) || w.ptr != cell.data() + blank ||
      s.ptr != of_week.data() + of_week.size())
    return std::nullopt;
  const double us = k_gps_epoch_us + std::round((week * 604800.0 + seconds) * 1e6);
  return static_cast<std::int64_t>(us) - leap_us(us);
}

/// Moments of a column, each once, in order.
std::vector<double> times_of(const ForeignTable& table, std::string_view column) {
  std::vector<double> out;
  const auto at = table.column(column);
  for (std::size_t row = 0; at && row < table.n_rows(); ++row)
    if (const double value = table.number(table.cell(row, *at)); std::isfinite(value)) out.push_back(value);
  std::ranges::sort(out);
  out.erase(std::unique(out.begin(), out.end()), out.end());
  return out;
}

struct UnitLength {
  TimeUnit unit;
  double s;
};
constexpr std::array k_unit_lengths{UnitLength{TimeUnit::s, 1}, UnitLength{TimeUnit::ms, 1e-3},
                                    UnitLength{TimeUnit::us, 1e-6}, UnitLength{TimeUnit::ns, 1e-9}};
/// 2 kHz to 0.2 Hz; of moments that a calendar shows, gaps do no harm.
constexpr double k_shortest_s = 1 / 2000.0, k_longest_s = 5, k_longest_of_date_s = 499;
/// Of numbers since 1970: 1999 to 2103. Of those since a machine was switched on: at most ten days of work,
/// and a flight of at least five seconds.
constexpr double k_first_date_s = 9.4e8, k_last_date_s = 4.2e9, k_most_uptime_s = 864000,
                 k_least_flight_s = 5;

/// Units in which sorted moments can be those of the rows of a flight.
std::vector<TimeUnit> fitting_units(const std::vector<double>& times) {
  std::vector<TimeUnit> out;
  if (times.empty()) return out;
  // Between the first and the last tenth, so that a stray row decides nothing.
  const std::size_t n = times.size(), from = n / 10, to = n - 1 - from;
  const double spacing = to > from ? (times[to] - times[from]) / static_cast<double>(to - from) : 0;
  for (const auto& [unit, s] : k_unit_lengths) {
    const double at_s = times[n / 2] * s, each_s = spacing * s;
    if (at_s > k_first_date_s && at_s < k_last_date_s && each_s <= k_longest_of_date_s &&
        (spacing == 0 || each_s >= k_shortest_s))
      return {unit};
    if (each_s >= k_shortest_s && each_s <= k_longest_s && std::abs(at_s) <= k_most_uptime_s &&
        (times[to] - times[from]) * s >= 0.8 * k_least_flight_s)
      out.push_back(unit);
  }
  return out;
}

/// Its topics as CSV (ulog2csv) have `timestamp` in microseconds since boot.
bool is_px4(const ForeignTable& table) {
  return std::ranges::any_of(table.columns(), [](const auto& column) {
    return column == "timestamp_sample" || column == "ref_timestamp" || column == "timestamp_time_relative";
  });
}

/// By its last word, or by one that is written together: TimeUS of ArduPilot.
std::optional<TimeUnit> time_unit_of_name(std::string_view name) {
  const auto at = name.rfind('_');
  const auto word = at != std::string_view::npos ? name.substr(at + 1)
                    : name.starts_with("time")   ? name.substr(4)
                                                 : std::string_view();
  if (at == std::string_view::npos && word == "s") return std::nullopt;  // "times"
  if (word == "s" || word == "sec" || word == "secs" || word == "seconds") return TimeUnit::s;
  if (word == "ms" || word == "msec") return TimeUnit::ms;
  if (word == "us" || word == "usec") return TimeUnit::us;
  if (word == "ns" || word == "nsec") return TimeUnit::ns;
  return std::nullopt;
}

struct NumberedFix {
  FixNumbers numbers;
  std::array<std::optional<FixClass>, 7> of;  ///< by the number
};
constexpr auto k_none = FixClass::none, k_single = FixClass::single, k_dgps = FixClass::dgps,
               k_float = FixClass::rtk_float, k_fixed = FixClass::rtk_fixed;
constexpr std::array k_numbered{
    NumberedFix{FixNumbers::solution, {k_single, k_float, k_fixed, {}, {}, {}, {}}},
    NumberedFix{FixNumbers::nmea, {k_none, k_single, k_dgps, k_single, k_fixed, k_float, k_none}},
    NumberedFix{FixNumbers::rtklib, {k_none, k_fixed, k_float, k_dgps, k_dgps, k_single, k_dgps}},
    NumberedFix{FixNumbers::mavlink, {k_none, k_none, k_single, k_single, k_dgps, k_float, k_fixed}}};
struct FixWords {
  FixClass fix;
  std::string_view words;
};
constexpr std::array k_worded{
    FixWords{k_fixed, " fixed fix rtk_fixed rtk_fix rtkfixed rtkfix narrow_int integer "},
    FixWords{k_float, " float rtk_float rtkfloat narrow_float "},
    FixWords{k_dgps, " dgps dgnss sbas waas psrdiff "},
    FixWords{k_single, " single spp autonomous gnss gps 2d 3d 2d_fix 3d_fix "},
    FixWords{k_none, " none no_fix nofix no invalid "}};

}  // namespace

bool contains(std::string_view text, std::string_view part) {
  return text.find(part) != std::string_view::npos;
}

double per_metre(LengthUnit unit) {
  switch (unit) {
    case LengthUnit::m:
      return 1;
    case LengthUnit::cm:
      return 100;
    case LengthUnit::mm:
      return 1000;
  }
  return 1;
}

TimeGuess time_guess(const ForeignTable& table, std::string_view column) {
  const std::string name = plain_name(column);
  const auto sample = table.sample(column);
  const std::string_view first = sample.empty() ? std::string_view() : sample.front();
  TimeGuess out;
  // A word "gps", or one that begins "gpst", at the beginning of the name or behind a "_".
  for (auto at = name.find("gps"); at != std::string::npos; at = name.find("gps", at + 1)) {
    const bool begins = at == 0 || name[at - 1] == '_', ends = at + 3 == name.size();
    if (begins && (ends || name[at + 3] == 't' || name[at + 3] == '_')) out.reading.scale = TimeScale::gps;
  }
  if (has_colon_or_slash(first)) {
    out.reading.unit = TimeUnit::date;
    return out;
  }
  const auto units = time_unit_of_name(name)                ? std::vector{*time_unit_of_name(name)}
                     : name == "timestamp" && is_px4(table) ? std::vector{TimeUnit::us}
                                                            : fitting_units(times_of(table, column));
  const double v = table.number(first);
  out.reading.unit = !units.empty() ? units.front()
                     : v > 1e17     ? TimeUnit::ns
                     : v > 1e14     ? TimeUnit::us
                     : v > 1e11     ? TimeUnit::ms
                                    : TimeUnit::s;
  if (units.size() > 1) out.fits = units;
  return out;
}

std::optional<LengthUnit> unit_of_name(std::string_view column) {
  const std::string name = plain_name(column);
  const auto at = name.rfind('_');
  return at == std::string::npos ? std::nullopt : k_length_unit_words.find(name.substr(at + 1));
}

LengthUnit range_unit(const ForeignTable& table, std::string_view column) {
  if (const auto unit = unit_of_name(column)) return *unit;
  const auto values = table.sample_numbers(column);
  const auto n_large = std::ranges::count_if(values, [](double v) { return v > 400; });
  return 2 * static_cast<std::size_t>(n_large) > table.sample(column).size() ? LengthUnit::mm : LengthUnit::m;
}

std::optional<FixNumbers> fix_numbers(const ForeignTable& table, std::string_view column) {
  const auto at = table.column(column);
  bool any = false, fix = false, of_rtk = false;
  for (std::size_t row = 0; at && row < table.n_rows() && !any; ++row) {
    const auto cell = table.cell(row, *at);
    any = !cell.empty() && std::ranges::all_of(cell, is_digit);
    const auto known = any ? std::nullopt : fix_of(cell, FixNumbers::gnss);
    fix = fix || plain_name(cell) == "fix";
    of_rtk = of_rtk || known == k_float || known == k_fixed;
  }
  // Receivers without RTK write FIX for any position; beside FLOAT it is the other state of RTK.
  if (!any) return fix && !of_rtk ? FixNumbers::gnss : FixNumbers::words;
  // Names that one of them alone goes by; "fix", "quality" and "rtk" are used with any.
  const std::string name = plain_name(column);
  if (name == "q") return FixNumbers::rtklib;
  if (contains(name, "carrsoln") || contains(name, "carr_soln")) return FixNumbers::solution;
  if (contains(name, "gga") || contains(name, "gps_qual") || contains(name, "fix_quality"))
    return FixNumbers::nmea;
  return std::nullopt;
}

std::optional<std::int64_t> time_us(const ForeignTable& table, std::string_view cell,
                                    const TimeReading& reading, std::int64_t epoch_us) {
  if (const auto week = week_us(cell)) return week;
  if (reading.unit == TimeUnit::date) return date_us(cell, reading.scale);
  constexpr std::array<double, 5> k_us{0, 1e6, 1e3, 1, 1e-3};
  const double us = table.number(cell) * k_us[static_cast<std::size_t>(reading.unit)];
  if (!std::isfinite(us) || std::abs(us) > k_most_us) return std::nullopt;
  if (us < k_flight_us) return std::llround(static_cast<double>(epoch_us) + us);
  if (reading.scale == TimeScale::utc) return std::llround(us);
  const double since_1970_us = us + k_gps_epoch_us;
  return std::llround(since_1970_us) - leap_us(since_1970_us);
}

std::optional<FixClass> fix_of(std::string_view cell, FixNumbers numbers) {
  const auto numbered = std::ranges::find(k_numbered, numbers, &NumberedFix::numbers);
  if (numbered != k_numbered.end() && cell.size() == 1 && cell[0] >= '0' && cell[0] <= '6') {
    if (const auto fix = numbered->of[static_cast<std::size_t>(cell[0] - '0')]) return fix;
  }
  const std::string word = plain_name(cell);
  if (word.empty()) return std::nullopt;
  if (numbers == FixNumbers::gnss && word == "fix") return k_single;
  for (const auto& known : k_worded) {
    if (contains(known.words, ' ' + word + ' ')) return known.fix;
  }
  return std::nullopt;
}

ForeignId foreign_id(std::string_view text) {
  // Some programs write whole numbers as 27183.0.
  auto number = text;
  if (const auto point = text.find('.'); point != std::string_view::npos && point + 1 < text.size() &&
                                         text.find_first_not_of('0', point + 1) == std::string_view::npos)
    number = text.substr(0, point);
  if (const auto id = parse_network_id(number)) return {id.value(), false};
  return {network_id_of(text), true};
}

}  // namespace anchord::api
