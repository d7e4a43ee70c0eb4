#pragma once

#include <filesystem>

#include "core/base/result.hpp"
#include "core/types/flight_data.hpp"

namespace anchord {

/// Reads a flight folder: flight.json, track.csv[.gz] (unless the track stands in the ranges) and
/// ranges.csv[.gz]. Layout in docs/formats.md. Files of truth or of other people's estimates are never
/// opened.
///
/// Rows keep their order. Values that are numbers but absurd (zero ranges, nan) pass: the solver refuses and
/// counts them. Columns it does not know are listed in FlightData::notes. errors  not_found (folder or file),
/// invalid_argument; the message begins with file and line
/// exclusions.json, where there is one, comes as FlightData::exclusions; nothing is left out yet.
Result<FlightData> read_flight_folder(const std::filesystem::path& folder);

/// Takes the rows out that FlightData::exclusions say, and counts them. Before anything is solved.
void leave_out_excluded(FlightData& flight);

/// Writes the same layout, plain CSV, times to the microsecond; creates the folder. CIRs and truth are not
/// part of it. errors  storage_unavailable (cannot write), invalid_argument (fixes of two frames, not the
/// mission's)
Result<void> write_flight_folder(const FlightData& flight, const std::filesystem::path& folder);

}  // namespace anchord
