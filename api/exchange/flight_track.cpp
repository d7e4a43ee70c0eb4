#include "api/exchange/flight_track.hpp"

#include <Eigen/Core>

#include "core/geo/enu.hpp"
#include "core/ports/measurement_store.hpp"

namespace anchord::api {
namespace {

/// Below the noise of an RTK position, so that nothing of the path is lost, and hovering is not a thousand
/// vertices.
constexpr double k_first_spacing_m = 0.05;

double distance_m(const Wgs84& a, const Wgs84& b) { return (ecef_from_wgs84(a) - ecef_from_wgs84(b)).norm(); }

/// Keeps the first and what is a spacing away from the one kept before.
void thin(FlightTrack& track) {
  std::vector<FlightTrack::Vertex> kept;
  for (const auto& vertex : track.vertices) {
    if (kept.empty() || distance_m(kept.back().at, vertex.at) >= track.spacing_m) kept.push_back(vertex);
  }
  track.vertices = std::move(kept);
}

}  // namespace

Result<FlightTrack> flight_track(MeasurementStore& measurements, const MissionId& mission) {
  FlightTrack track;
  track.spacing_m = k_first_spacing_m;
  MeasurementStore::Filter filter;
  filter.mission = mission;
  filter.limit = 10'000;
  do {
    BOOST_OUTCOME_TRY(const auto page, measurements.fixes(filter));
    for (const auto& fix : page.rows) {
      if (fix.frame != TrackFrame::wgs84 || fix.fix == FixClass::none) continue;
      ++track.n_fixes;
      if (!track.vertices.empty() && distance_m(track.vertices.back().at, fix.position) < track.spacing_m)
        continue;
      track.vertices.push_back({fix.position, fix.time});
      while (track.vertices.size() > k_max_vertices) {
        track.spacing_m *= 2;
        thin(track);
      }
    }
    filter.after = page.next;
  } while (!filter.after.empty());
  return track;
}

}  // namespace anchord::api
