#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "core/base/result.hpp"
#include "core/geo/source_crs.hpp"
#include "core/types/mission.hpp"

namespace anchord {

/// flight.json: what an operator declares about a flight. Layout in docs/formats.md.
struct FlightDeclaration {
  Mission mission;
  UtcTime epoch{};  ///< t_s = 0
  /// The track is in another system, still to be put on the globe; mission.frame is local until then.
  std::optional<SourceCrsSpec> source{};
  bool track_in_ranges{false};  ///< the pose stands in each range row
  bool quaternion{false};
  std::string heading_column;  ///< empty: none
  double heading_add_deg{0};   ///< added to the column: counter-clockwise from east
};

/// errors: not_found; invalid_argument naming the file and the key (unknown keys too: a typo is how a setting
/// gets lost)
Result<FlightDeclaration> read_flight_json(const std::filesystem::path& file);
Result<void> write_flight_json(const FlightDeclaration& flight, const std::filesystem::path& file);

/// Number of an id text: 0x6a2f and 101 as they read, any other text by a hash with the top bit set, so that
/// the same name is the same device in every flight.
NetworkId network_id_of(std::string_view text);

}  // namespace anchord
