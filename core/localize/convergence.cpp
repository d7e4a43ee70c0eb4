#include "core/localize/convergence.hpp"

#include <algorithm>
#include <numeric>

#include "core/localize/flight_solver.hpp"

namespace anchord {
namespace {

std::optional<Eigen::Vector3d> place(const Estimate& estimate) {
  if (!estimate.best) return std::nullopt;
  return estimate.best->position.m;
}

/// What an iteration adds of its own ranges: those from `from` on.
void add_ranges(const AnchorSolution& anchor, UtcTime from, ConvergenceStep& at) {
  std::vector<const RangeResidual*> ranges;
  for (const RangeResidual& range : anchor.residuals) {
    if (range.time < from) continue;
    ranges.push_back(&range);
    if (range.p_los) ++(*range.p_los >= 0.5 ? at.n_los : at.n_nlos);
  }
  if (ranges.empty()) return;
  const auto middle = ranges.begin() + static_cast<std::ptrdiff_t>(ranges.size() / 2);
  std::ranges::nth_element(ranges, middle, {}, [](const RangeResidual* range) {
    return range->distance_m - (range->corrected_m - range->residual_m);
  });
  at.middle = CorrectedRange{(*middle)->tag_m, (*middle)->distance_m, (*middle)->corrected_m};
}

/// The flight in order of time, each range with what belongs to it.
FlightData in_time_order(const FlightData& flight) {
  std::vector<std::size_t> order(flight.n_ranges());
  std::iota(order.begin(), order.end(), 0U);
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return flight.range(i).time; });
  const auto ordered = [&](const auto& of_ranges) {
    auto out = of_ranges;
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = of_ranges[order[k]];
    return out;
  };
  FlightData out = flight;
  out.keep_rows();
  out.rows = ordered(out.rows);
  out.error_models = ordered(flight.error_models);
  out.received_m = ordered(flight.received_m);
  return out;
}

/// Its first n ranges.
FlightData first_part(const FlightData& flight, std::size_t n) {
  FlightData part = flight;
  part.rows.resize(n);
  part.error_models.resize(std::min(n, flight.error_models.size()));
  part.received_m.resize(std::min(n, flight.received_m.size()));
  return part;
}

FlightOptions raw_options(const FlightOptions& options) {
  FlightOptions raw = options;
  raw.fixed_bias_m = 0.0;
  raw.loss = Loss::none;
  raw.profile.reset();
  return raw;
}

}  // namespace

FlightData as_received(FlightData flight) {
  for (std::size_t i = 0; i < flight.received_m.size(); ++i) flight.rows[i].distance_m = flight.received_m[i];
  flight.received_m.clear();
  flight.error_models.clear();
  return flight;
}

Result<Convergence> convergence_of(const FlightData& flight, const FlightOptions& options, int steps) {
  if (steps < 1 || steps > 50) return make_error(Errc::invalid_argument, "iterations must be 1 to 50");
  BOOST_OUTCOME_TRYV(options.check());
  const FlightData whole = in_time_order(flight);
  const std::vector<FlightRange>& all = whole.rows;
  Convergence course;
  std::map<NetworkId, std::size_t> heard;
  std::size_t counted = 0;
  for (int step = 1; step <= steps; ++step) {
    if (options.canceled && options.canceled()) return make_error(Errc::canceled, "canceled");
    const std::size_t n = all.size() * static_cast<std::size_t>(step) / static_cast<std::size_t>(steps);
    if (counted == n) continue;  // fewer ranges than steps
    const UtcTime from = all[counted].time;
    for (; counted < n; ++counted) ++heard[all[counted].anchor];
    const FlightData part = first_part(whole, n);
    const auto raw = solve_flight(as_received(part), raw_options(options));
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
      add_ranges(anchor, from, at);
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
