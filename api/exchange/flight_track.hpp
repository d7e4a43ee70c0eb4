#pragma once

#include <cstddef>
#include <vector>

#include "core/base/ids.hpp"
#include "core/base/result.hpp"
#include "core/base/time.hpp"
#include "core/types/position.hpp"

namespace anchord {
class MeasurementStore;
}

namespace anchord::api {

/// Most vertices of one line: a GIS draws no more of a flight than this.
inline constexpr std::size_t k_max_vertices = 10'000;

/// The path of one flight for maps: positions as they were received, without those nearer than a spacing from
/// the vertex before. In a local frame, or with no position at all, it has no vertices.
struct FlightTrack {
  struct Vertex {
    Wgs84 at{};
    UtcTime time{};
  };
  std::vector<Vertex> vertices;
  double spacing_m{};     ///< vertices are no nearer to each other than this
  std::size_t n_fixes{};  ///< positions with a place on the globe, before thinning
};

/// Reads the flight page by page and holds at most k_max_vertices of it: where 5 cm between vertices are
/// too many, the spacing doubles until they fit. Errors are the store's: not_found where the flight was
/// deleted meanwhile.
Result<FlightTrack> flight_track(MeasurementStore& measurements, const MissionId& mission);

}  // namespace anchord::api
