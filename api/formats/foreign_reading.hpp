#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "api/formats/foreign_flight.hpp"

namespace anchord::api {

/// How the values are written.
struct Reading {
  ForeignColumns tc, rc;
  PlaceKind kind{};
  bool local{};  ///< x, y, z
  TimeReading track_time, range_time;
  /// Units that a column of times may be in, where two or more fit.
  std::vector<TimeUnit> track_units, range_units;
  double range_per_metre{1}, height_per_metre{1};
  std::optional<FixNumbers> fix;
  std::optional<HeadingKind> heading;
  std::optional<AddressKind> addresses;
  std::optional<TrackAxes> axes;
  std::optional<std::string> crs, heights;
  bool heights_matter{};
  std::string contradiction;  ///< a column of units that is not read, or two options that cannot both hold
};

Reading reading_of(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& options);
Needs needs_of(const Reading& reading, const std::string& tag);
/// What is not known, and which option says it.
std::string words_of(const std::string& need, const ForeignTable& track, const ForeignTable& ranges,
                     const Reading& reading);
/// errors  invalid_argument: no such field, no such column
Result<void> check_columns(const ForeignTable& table, const ForeignColumns& columns, const char* of);

/// Its name; empty where the field has none.
std::string_view column_of(const ForeignColumns& columns, std::string_view field);
/// Those known by name, with what a person says in their place.
ForeignColumns merged(ForeignColumns guessed, const ForeignColumns& said);
std::string listed(const std::vector<std::string>& names);

}  // namespace anchord::api
