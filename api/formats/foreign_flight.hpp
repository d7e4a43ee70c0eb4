#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "api/formats/foreign_axes.hpp"
#include "api/formats/foreign_columns.hpp"
#include "api/formats/foreign_meaning.hpp"
#include "api/formats/foreign_values.hpp"
#include "core/geo/source_crs.hpp"
#include "core/types/flight_data.hpp"

namespace anchord::api {

/// What no table says, and what a person says of its columns; what is absent is taken from names and values.
struct ForeignOptions {
  ForeignColumns track_columns, range_columns;  ///< in place of those known by name; empty: no column
  bool column_for_each_anchor{false};
  std::optional<TimeUnit> track_time_unit{}, range_time_unit{};
  std::optional<TimeScale> track_time_scale{}, range_time_scale{};
  std::optional<LengthUnit> range_unit{}, height_unit{};
  std::optional<FixNumbers> fix_numbers{};
  std::optional<HeadingKind> heading{};
  std::optional<AddressKind> addresses{};
  std::optional<TrackAxes> axes{};
  std::optional<std::string> crs{};  ///< of x, y, z, as SourceCrsSpec has it; empty: a local frame
  /// "ellipsoidal", "column" (another column has the height of the geoid), or as read_heights() takes it
  std::optional<std::string> heights{};
  double max_datum_error_m{SourceCrsSpec{}.max_datum_error_m};
  std::string name{}, kit{};
  std::int64_t epoch_us{0};  ///< of t = 0, where times are seconds of the flight
  TrackPoint point{TrackPoint::gnss_antenna};
  Eigen::Vector3d lever_arm_body_m{0, 0, 0};
  std::map<std::string, Eigen::Vector3d> lever_arms_body_m{};  ///< of tags, which come before the one of all
  std::optional<double> lever_arm_sigma_m{};
  std::string tag{};  ///< where no column says it
};

struct ForeignFlight {
  FlightData data;
  std::vector<std::string> refused;                ///< rows that are no numbers, in words
  std::map<std::string, std::size_t> unknown_fix;  ///< fix classes that say nothing, and how many positions
  /// The system that the places are in (as local_m), where they have still to be put on the globe.
  std::optional<SourceCrsSpec> source;
};

/// One thing that a person has to say, by the words of web/src/views/start/flight_files.ts.
using Needs = std::vector<std::string>;
Needs foreign_needs(const ForeignTable& track, const ForeignTable& ranges, const ForeignOptions& options);

/// `track` and `ranges` may be one table with a pose in each range.
/// errors  invalid_argument: what is not known and which option says it, a column that is not there, two
/// names of one address
Result<ForeignFlight> foreign_flight(const ForeignTable& track, const ForeignTable& ranges,
                                     const ForeignOptions& options);

/// The same on the globe, with notes of what was taken for granted and what was left out. Without a track,
/// each range has a pose. errors  also: nothing usable in it, those of put_on_globe()
Result<FlightData> read_foreign_flight(const std::optional<ForeignTable>& track, ForeignTable ranges,
                                       const ForeignOptions& options);

}  // namespace anchord::api
