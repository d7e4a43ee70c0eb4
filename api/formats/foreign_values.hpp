#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/foreign_table.hpp"
#include "core/base/enum_table.hpp"
#include "core/types/fix.hpp"

namespace anchord::api {

enum class TimeUnit : std::uint8_t { date, s, ms, us, ns };
inline constexpr auto k_time_unit_words = enum_table<TimeUnit>({{"date", TimeUnit::date},
                                                                {"s", TimeUnit::s},
                                                                {"ms", TimeUnit::ms},
                                                                {"us", TimeUnit::us},
                                                                {"ns", TimeUnit::ns}});
/// UTC, or the time of GPS: 18 s ahead of UTC since 2017; its numbers count from 6 January 1980.
enum class TimeScale : std::uint8_t { utc, gps };
inline constexpr auto k_time_scale_words =
    enum_table<TimeScale>({{"utc", TimeScale::utc}, {"gps", TimeScale::gps}});
struct TimeReading {
  TimeUnit unit{TimeUnit::s};
  TimeScale scale{TimeScale::utc};
};
enum class LengthUnit : std::uint8_t { m, cm, mm };
inline constexpr auto k_length_unit_words =
    enum_table<LengthUnit>({{"m", LengthUnit::m}, {"cm", LengthUnit::cm}, {"mm", LengthUnit::mm}});
double per_metre(LengthUnit unit);

/// What the numbers of a fix column mean; `words` where it has none. Who takes one for the other believes
/// single positions as RTK fixed ones. `gnss`: words, and "FIX" alone is any fix of a receiver.
enum class FixNumbers : std::uint8_t { words, gnss, solution, nmea, rtklib, mavlink };
inline constexpr auto k_fix_numbers_words = enum_table<FixNumbers>({{"words", FixNumbers::words},
                                                                    {"gnss", FixNumbers::gnss},
                                                                    {"solution", FixNumbers::solution},
                                                                    {"nmea", FixNumbers::nmea},
                                                                    {"rtklib", FixNumbers::rtklib},
                                                                    {"mavlink", FixNumbers::mavlink}});

bool contains(std::string_view text, std::string_view part);

struct TimeGuess {
  TimeReading reading;
  std::vector<TimeUnit> fits{};  ///< where two or more units are possible and a person has to say which
};
/// By the name of the column; by values that are moments of this century; by the rate of rows, which is 0.2
/// Hz to 2 kHz; else by how its first value looks.
TimeGuess time_guess(const ForeignTable& table, std::string_view column);
/// By the ending of a column's name.
std::optional<LengthUnit> unit_of_name(std::string_view column);
LengthUnit range_unit(const ForeignTable& table, std::string_view column);
/// Nothing where a person has to say it.
std::optional<FixNumbers> fix_numbers(const ForeignTable& table, std::string_view column);

/// Microseconds since 1970 UTC; nothing where it is no moment. A week and its seconds are of GPS, whatever
/// else is said. `epoch_us`: of a flight whose times count from its beginning.
std::optional<std::int64_t> time_us(const ForeignTable& table, std::string_view cell,
                                    const TimeReading& reading, std::int64_t epoch_us);
/// Nothing where the cell says nothing that is known.
std::optional<FixClass> fix_of(std::string_view cell, FixNumbers numbers);

/// An address as the API takes it; of a name one is made (network_id_of), and `is_name` says so.
struct ForeignId {
  NetworkId id{};
  bool is_name{};
};
ForeignId foreign_id(std::string_view text);

}  // namespace anchord::api
