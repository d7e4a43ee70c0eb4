#include "core/localize/convergence.hpp"

#include <algorithm>

#include "core/localize/flight_solver.hpp"

namespace anchord {
namespace {

std::optional<Eigen::Vector3d> place(const Estimate& estimate) {
  if (!estimate.best) return std::nullopt;
  return estimate.best->position.m;
}

FlightOptions raw_options(const FlightOptions& options) {
  FlightOptions raw = options;
  raw.fixed_bias_m = 0.0;
  raw.loss = Loss::none;
  raw.profile.reset();
  return raw;
}

}  // namespace

Result<Convergence> convergence_of(const FlightData& flight, const FlightOptions& options, int steps) {
  if (steps < 1 || steps > 50) return make_error(Errc::invalid_argument, "1 to 50 iterations");
  BOOST_OUTCOME_TRYV(options.check());
  FlightData part = flight;
  std::ranges::stable_sort(part.ranges, {}, &Range::time);
  const std::vector<Range> all = part.ranges;
  Convergence course;
  std::map<NetworkId, std::size_t> heard;
  std::size_t counted = 0;
  for (int step = 1; step <= steps; ++step) {
    if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
    const std::size_t n = all.size() * static_cast<std::size_t>(step) / static_cast<std::size_t>(steps);
    for (; counted < n; ++counted) ++heard[all[counted].anchor];
    part.ranges.assign(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(n));
    const auto raw = solve_flight(part, raw_options(options));
    const auto corrected = solve_flight(part, options);
    if (!corrected) {
      if (corrected.error().code == Errc::canceled) return corrected.error();
      continue;  // too few ranges yet
    }
    for (const auto& anchor : corrected.value().anchors) {
      ConvergenceStep at;
      at.share = static_cast<double>(step) / steps;
      at.n_ranges = heard[anchor.estimate.anchor];
      at.corrected_m = place(anchor.estimate);
      at.h95_m = anchor.estimate.h95_m;
      at.verdict = anchor.estimate.verdict;
      if (raw) {
        for (const auto& other : raw.value().anchors) {
          if (other.estimate.anchor == anchor.estimate.anchor) at.raw_m = place(other.estimate);
        }
      }
      course[anchor.estimate.anchor].push_back(at);
    }
  }
  return course;
}

}  // namespace anchord
