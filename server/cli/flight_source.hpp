#pragma once

#include <map>
#include <string>
#include <vector>

#include "core/base/result.hpp"
#include "core/types/flight_data.hpp"

namespace CLI {
class App;
}  // namespace CLI

namespace anchord::cli {

/// A flight in tables of another program, as the command line names them.
struct ForeignSource {
  std::string track, ranges, mapping;
  std::vector<std::string> columns;
  std::map<std::string, std::string> settings;  ///< option -> its text
  bool column_for_each_anchor{false};

  bool given() const { return !track.empty() || !ranges.empty(); }
  std::string name() const;
};

/// --track, --ranges and what says how they are written. Options that the command has already are left out.
void add_foreign_source(CLI::App& command, ForeignSource& source);
/// The track may be a GNSS log (NMEA, UBX), of which one position an epoch is taken.
/// errors  invalid_argument: what is not known and which option says it; not_found
Result<FlightData> read_foreign_source(const ForeignSource& source);

}  // namespace anchord::cli
