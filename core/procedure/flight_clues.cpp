#include "core/procedure/flight_clues.hpp"

#include <cmath>

namespace anchord::procedure {
namespace {

/// Of the lobes: walls shift the height at which a signal is strongest more than the fit of its peak shows.
constexpr double k_lobe_sigma_m = 0.5;
/// From afar a search of three metres hardly bends the level: what peak is found there is one of the noise.
constexpr double k_least_significance = 5;

}  // namespace

FlightClues flight_clues(const std::map<NetworkId, Clues>& clues, const EnuFrame& plan) {
  FlightClues out;
  for (const auto& [anchor, of] : clues) {
    FlightClue clue;
    if (of.bearing && of.turned_at_m)
      clue.bearing = {plan.wgs84_from_enu(Enu{*of.turned_at_m}), of.bearing->bearing_rad,
                      of.bearing->sigma_rad};
    if (of.height && of.climbed_at_m && !of.height->at_edge &&
        of.height->significance >= k_least_significance)
      clue.height = {
          plan.wgs84_from_enu(Enu{{of.climbed_at_m->x(), of.climbed_at_m->y(), of.height->height_m}}),
          std::hypot(of.height->sigma_m, k_lobe_sigma_m)};
    if (clue.bearing || clue.height) out[anchor] = clue;
  }
  return out;
}

std::map<NetworkId, AnchorClues> clues_in(const FlightClues& clues, const EnuFrame& answers) {
  std::map<NetworkId, AnchorClues> out;
  for (const auto& [anchor, clue] : clues) {
    AnchorClues& prior = out[anchor];
    if (clue.bearing)
      prior.bearing = {answers.enu_from_wgs84(clue.bearing->from).m, clue.bearing->bearing_rad,
                       clue.bearing->sigma_rad};
    if (clue.height) prior.height = {answers.enu_from_wgs84(clue.height->at).m.z(), clue.height->sigma_m};
  }
  return out;
}

FlightClues merged(FlightClues older, const FlightClues& newer) {
  for (const auto& [anchor, clue] : newer) {
    FlightClue& out = older[anchor];
    if (clue.bearing) out.bearing = clue.bearing;
    if (clue.height) out.height = clue.height;
  }
  return older;
}

}  // namespace anchord::procedure
