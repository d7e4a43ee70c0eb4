#include "core/localize/start_search.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

#include "core/localize/first_guess.hpp"
#include "core/localize/joint_model.hpp"
#include "core/localize/linear.hpp"
#include "core/localize/solver.hpp"
#include "core/localize/warm_solve.hpp"

namespace anchord {
namespace {

constexpr std::size_t k_min_rows = 5;  // one more than x, y, z and a shared bias ask for
constexpr double k_same_place_m = 0.2;
constexpr std::size_t k_most_places = 6;

/// The start somebody gave: a place, or what the turn and the height search say with the ranges
/// (8.4.1, 8.4.2).
std::optional<Eigen::Vector3d> told_start(NetworkId id, const std::vector<Observation>& rows,
                                          const AnchorPriors& priors, const FlightOptions& options) {
  if (const auto told = options.starts.find(id); told != options.starts.end()) return told->second;
  if (!options.start_at_priors || !priors.bearing || !priors.height) return std::nullopt;
  return guess_from_turn(rows, priors.bearing->tag_m, priors.bearing->bearing_rad, priors.height->up_m);
}

/// Counts an end of the search where it is, or with the place it shares.
void note_end(StartSearch& search, const AnchorMinimum& end) {
  ++search.n_starts;
  search.n_settled += end.settled ? 1 : 0;
  const auto same = [&](const StartSearch::Place& p) {
    return (p.position_m - end.position_m).norm() < k_same_place_m;
  };
  auto place = std::ranges::find_if(search.places, same);
  if (place == search.places.end()) place = search.places.insert(place, {end.position_m, end.cost, 0, 0});
  ++place->n_starts;
  place->n_settled += end.settled ? 1 : 0;
  if (end.cost < place->cost) {
    place->cost = end.cost;
    place->position_m = end.position_m;
  }
}

/// Best of many starts for one anchor; Cauchy of 0.3 m and a bias of its own, so that a kit's bias does not
/// push the anchor into the wrong basin before the joint solve can see it. No places: too few rows.
StartSearch search_start(const FlightRows& flight, const AnchorRows& anchor, const SharedPrior& prior,
                         const FlightOptions& options, std::optional<double> height_m) {
  StartSearch search;
  const auto rows = observations_of(flight, anchor, prior.mean, 200, 0.3);
  if (rows.size() < k_min_rows) return search;
  SolverOptions settings;
  settings.dims = options.dims;
  settings.loss = Loss::cauchy;
  settings.loss_sigmas = 1.0;
  settings.estimate_bias = !options.fixed_bias_m;
  settings.bias_prior_sigma_m = 0.5;
  settings.step_tolerance_m = 1e-5;  // the joint solve goes on from here
  const AnchorPriors priors = priors_of(anchor.id, options);
  const auto levels = levels_of(flight, anchor, prior.mean, options);
  const double span_s = std::max(anchor.rows.back().t_s - anchor.rows.front().t_s, 1.0);
  const double alike =
      std::max(2.0 * options.correlation_s * static_cast<double>(levels.size()) / span_s, 1.0);
  auto starts = start_candidates(rows, options.dims);
  if (const auto told = told_start(anchor.id, rows, priors, options)) starts = {*told};
  RangeBlock block(rows);
  for (Eigen::Vector3d start : starts) {
    if (height_m) start.z() = *height_m;
    auto end = descend_to_minimum(block, start, settings);
    if (!end) continue;
    // The mirror fits as well: a prior, told in the same unit, is what decides where to begin.
    AnchorMinimum& minimum = end.value();
    minimum.cost += prior_cost(priors, options.outline_m, options.outline_sigma_m, minimum.position_m);
    if (!levels.empty())
      minimum.cost += level_cost(levels, minimum.position_m, *options.level_sigma_db) / alike;
    note_end(search, minimum);
  }
  std::ranges::stable_sort(search.places, {}, &StartSearch::Place::cost);
  if (search.places.size() > k_most_places) search.places.resize(k_most_places);
  return search;
}

}  // namespace

JointStart joint_start(const FlightRows& flight, const SharedPrior& prior, const FlightOptions& options) {
  JointStart out;
  out.state.shared = prior.mean;
  std::optional<double> height_m;
  if (options.dims == Dims::two) {
    double sum_m = 0;
    for (const auto& pose : flight.track.poses()) sum_m += pose.position_m.z();
    height_m = options.anchor_height_m.value_or(sum_m / static_cast<double>(flight.track.poses().size()));
  }
  for (const AnchorRows& rows : flight.anchors) {
    out.searches.push_back(search_start(flight, rows, prior, options, height_m));
    const StartSearch& search = out.searches.back();
    JointState::Anchor anchor;
    anchor.active = !search.places.empty();
    if (anchor.active) anchor.position_m = search.places.front().position_m;
    out.state.anchors.push_back(anchor);
  }
  return out;
}

}  // namespace anchord
