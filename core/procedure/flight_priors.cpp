#include "core/procedure/flight_priors.hpp"

#include <cmath>

namespace anchord::procedure {
namespace {

/// Of the lobes: walls shift the height at which a signal is strongest more than the fit of its peak shows.
constexpr double k_lobe_sigma_m = 0.5;
/// From afar a search of three metres hardly bends the level: what peak is found there is one of the noise.
constexpr double k_least_significance = 5;

}  // namespace

FlightPriors flight_priors(const std::map<NetworkId, Priors>& priors, const EnuFrame& plan) {
  FlightPriors out;
  for (const auto& [anchor, of] : priors) {
    FlightPrior prior;
    if (of.bearing && of.turned_at_m)
      prior.bearing = {plan.wgs84_from_enu(Enu{*of.turned_at_m}), of.bearing->bearing_rad,
                       of.bearing->sigma_rad};
    if (of.height && of.climbed_at_m && !of.height->at_edge && !of.height->too_narrow &&
        of.height->significance >= k_least_significance)
      prior.height = {
          plan.wgs84_from_enu(Enu{{of.climbed_at_m->x(), of.climbed_at_m->y(), of.height->height_m}}),
          std::hypot(of.height->sigma_m, k_lobe_sigma_m)};
    if (prior.bearing || prior.height) out[anchor] = prior;
  }
  return out;
}

std::map<NetworkId, AnchorPriors> priors_in(const FlightPriors& priors, const EnuFrame& answers) {
  std::map<NetworkId, AnchorPriors> out;
  for (const auto& [anchor, found] : priors) {
    AnchorPriors& prior = out[anchor];
    if (found.bearing)
      prior.bearing = {answers.enu_from_wgs84(found.bearing->from).m, found.bearing->bearing_rad,
                       found.bearing->sigma_rad};
    if (found.height) prior.height = {answers.enu_from_wgs84(found.height->at).m.z(), found.height->sigma_m};
  }
  return out;
}

FlightPriors merged(FlightPriors older, const FlightPriors& newer) {
  for (const auto& [anchor, prior] : newer) {
    FlightPrior& out = older[anchor];
    if (prior.bearing) out.bearing = prior.bearing;
    if (prior.height) out.height = prior.height;
  }
  return older;
}

}  // namespace anchord::procedure
