#include "core/planning/next_point.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>

#include "core/planning/gdop.hpp"
#include "core/planning/information.hpp"
#include "core/planning/refusals.hpp"
#include "core/planning/sight.hpp"

namespace anchord::planning {
namespace {

constexpr double k_infinity = std::numeric_limits<double>::infinity();
constexpr double k_tie = 1e-9;  // relative; mirrored candidates differ by rounding only

/// Candidates above one another, side by side in the grid.
std::size_t column_height(const NextPointOptions& options) {
  return 2 * static_cast<std::size_t>(options.grid.reach_up) + 1;
}

/// One column of values over the grid, and the value before.
struct Column {
  double before{};
  std::vector<double> with;
};

template <int Dim>
Column traces(const NextPointInput& input, const PlannedAnchor& anchor, const Place& place,
              const NextPointOptions& options, const Grid& grid) {
  Geometry<Dim> base(place.position_m.head<Dim>());
  for (const auto i : anchor.measured_at) base.add(input.visited[i].head<Dim>());
  Column out;
  const auto before = base.gdop();
  out.before = before ? before.value().trace : k_infinity;
  out.with.resize(grid.size());
  if constexpr (Dim == 2) {
    traces_with(base, grid.x_m, grid.y_m, out.with);
  } else {
    traces_with(base, grid.x_m, grid.y_m, grid.z_m, out.with);
  }
  if (options.max_range_m) {
    for (std::size_t i = 0; i < grid.size(); ++i) {
      if (out_of_range(options, grid.at(i), place.position_m)) out.with[i] = out.before;
    }
  }
  return out;
}

/// As `traces`, with a millionth of a measurement added in every direction: ranks candidates while all of
/// them leave the geometry singular (the second point of a flight in 3D).
template <int Dim>
Column ridge_traces(const NextPointInput& input, const PlannedAnchor& anchor, const Place& place,
                    const Grid& grid) {
  const Point<Dim> at = place.position_m.head<Dim>();
  Geometry<Dim> base(at);
  for (const auto i : anchor.measured_at) base.add(input.visited[i].head<Dim>());
  const Square<Dim> inverse = (base.normal() + 1e-6 * Square<Dim>::Identity()).inverse();
  Column out{inverse.trace(), {}};
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const Point<Dim> d = grid.at(i).template head<Dim>() - at;
    const double length = d.norm();
    if (!(length > k_min_distance_m)) {
      out.with.push_back(k_infinity);
      continue;
    }
    const Point<Dim> gu = inverse * d / length;
    out.with.push_back(out.before - gu.squaredNorm() / (1 + d.dot(gu) / length));
  }
  return out;
}

Column informations(const NextPointInput& input, const PlannedAnchor& anchor, const Place& place,
                    const NextPointOptions& options, const Grid& grid, const Sights& sights) {
  Information base(place.position_m, anchor.covariance_m2, options);
  if (!anchor.covariance_m2) {
    for (const auto i : anchor.measured_at) {
      base.add(input.visited[i], expected_nlos(input, input.visited[i], place.position_m).value_or(1));
    }
  }
  Column out{base.now(), {}};
  out.with.reserve(grid.size());
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const auto point = grid.at(i);
    const auto nlos = out_of_range(options, point, place.position_m) ? std::nullopt : sights[i];
    out.with.push_back(nlos ? base.with(point, *nlos) : out.before);
  }
  return out;
}

/// Expectation over the places an anchor may be at. `first`: what is seen of the first of them.
Column anchor_column(const NextPointInput& input, const PlannedAnchor& anchor,
                     const NextPointOptions& options, const Grid& grid, bool ridge, const Sights& first) {
  double total = 0;
  for (const auto& place : anchor.places) total += place.probability;
  const auto column_of = [&](const Place& place) {
    if (options.rule != Rule::dissertation) {
      if (&place == &anchor.places.front()) return informations(input, anchor, place, options, grid, first);
      const Sights sights(input, grid, column_height(options), place.position_m);
      return informations(input, anchor, place, options, grid, sights);
    }
    if (options.dims == 2)
      return ridge ? ridge_traces<2>(input, anchor, place, grid)
                   : traces<2>(input, anchor, place, options, grid);
    return ridge ? ridge_traces<3>(input, anchor, place, grid)
                 : traces<3>(input, anchor, place, options, grid);
  };
  if (anchor.places.size() == 1) return column_of(anchor.places.front());
  Column out{0, std::vector<double>(grid.size(), 0.0)};
  for (const auto& place : anchor.places) {
    const double share = place.probability / total;
    if (share == 0) continue;
    const Column one = column_of(place);
    out.before += share * one.before;
    for (std::size_t i = 0; i < grid.size(); ++i) out.with[i] += share * one.with[i];
  }
  return out;
}

/// Position sigma an anchor has now, per axis, in units of its target; between 1e-3 and 1e3 so that no anchor
/// is forgotten and none shouts the others down.
double deficit(const PlannedAnchor& anchor, const NextPointOptions& options, double before) {
  double variance_m2 = before / options.dims;
  if (options.rule == Rule::dissertation) {
    variance_m2 *=
        options.los_sigma_m * options.los_sigma_m + options.position_sigma_m * options.position_sigma_m;
  }
  if (options.rule == Rule::d_optimal) variance_m2 = std::exp(before / options.dims);
  return std::clamp(std::sqrt(variance_m2) / anchor.target_m, 1e-3, 1e3);
}

double combine(const std::vector<double>& values, const std::vector<double>& weights, Combine how) {
  if (how == Combine::worst) return *std::max_element(values.begin(), values.end());
  double sum = 0, total = 0;
  for (std::size_t k = 0; k < values.size(); ++k) {
    sum += weights[k] * values[k];
    total += weights[k];
  }
  return sum / total;
}

/// combine() of every candidate.
std::vector<double> combined(const std::vector<std::vector<double>>& of_anchor,
                             const std::vector<double>& weights, Combine how) {
  std::vector<double> out = of_anchor.front();
  if (how == Combine::worst) {
    for (std::size_t k = 1; k < of_anchor.size(); ++k) {
      const auto& one = of_anchor[k];
      for (std::size_t i = 0; i < out.size(); ++i) out[i] = out[i] < one[i] ? one[i] : out[i];
    }
    return out;
  }
  double total = 0;
  for (const double w : weights) total += w;
  for (std::size_t k = 0; k < of_anchor.size(); ++k) {
    const auto& one = of_anchor[k];
    for (std::size_t i = 0; i < out.size(); ++i) out[i] = (k == 0 ? 0.0 : out[i]) + weights[k] * one[i];
  }
  for (double& value : out) value /= total;
  return out;
}

Result<void> check_input(const NextPointInput& input) {
  if (input.anchors.empty()) return make_error(Errc::invalid_argument, "no anchor to plan for");
  if (input.visited.empty() && !input.current) {
    return make_error(Errc::invalid_argument, "neither a visited point nor a current position");
  }
  for (const auto& p : input.visited) {
    if (!p.allFinite()) return make_error(Errc::invalid_argument, "a visited point is not finite");
  }
  for (const auto& anchor : input.anchors) {
    double total = 0;
    for (const auto& place : anchor.places) {
      if (!place.position_m.allFinite() || !(place.probability >= 0)) {
        return make_error(Errc::invalid_argument,
                          "anchor " + anchor.name + ": place not finite or probability negative");
      }
      total += place.probability;
    }
    if (!(total > 0))
      return make_error(Errc::invalid_argument, "anchor " + anchor.name + " has no possible place");
    if (!(anchor.weight > 0) || !(anchor.target_m > 0)) {
      return make_error(Errc::invalid_argument,
                        "anchor " + anchor.name + ": weight and target must be positive");
    }
    for (const auto i : anchor.measured_at) {
      if (i >= input.visited.size()) {
        return make_error(Errc::invalid_argument, "anchor " + anchor.name +
                                                      " was measured at visited point " + std::to_string(i) +
                                                      " of " + std::to_string(input.visited.size()));
      }
    }
  }
  return boost::outcome_v2::success();
}

std::string refused_words(const Refusals& refused) {
  std::map<std::string_view, int> counts;
  std::array<int, k_refusal_words.size()> n{};
  for (std::size_t i = 0; i < refused.size(); ++i) {
    if (refused.any(i)) ++n[static_cast<std::size_t>(*refused[i])];
  }
  for (std::size_t why = 0; why < n.size(); ++why) {
    if (n[why] > 0) counts[to_string(static_cast<Refusal>(why))] = n[why];
  }
  std::string out;
  for (const auto& [why, count] : counts)
    out += (out.empty() ? "" : ", ") + std::to_string(count) + " " + std::string(why);
  return out.empty() ? "none rejected" : "refused: " + out;
}

std::string words(const Decision& decision, const NextPointOptions& options, bool ridge) {
  const std::string total = "; " + std::to_string(decision.candidates.size()) + " candidates, ";
  if (!decision.chosen) return "no point left to fly to" + total + refused_words(decision.candidates.refused);
  const CandidateValue best = decision.candidates[*decision.chosen];
  std::array<char, 256> text{};
  if (ridge) {
    std::snprintf(text.data(), text.size(),
                  "geometry stays singular with any one point; best spread of directions");
  } else if (options.rule == Rule::dissertation) {
    std::snprintf(
        text.data(), text.size(), "lowest GDOP: trace %.4g (root %.4g), before: %s", best.value,
        std::sqrt(best.value),
        std::isfinite(decision.value_before) ? std::to_string(decision.value_before).c_str() : "singular");
  } else if (options.rule == Rule::a_optimal) {
    std::snprintf(text.data(), text.size(), "lowest expected error: %.3f m rms, before: %.3f m",
                  std::sqrt(best.value), std::sqrt(decision.value_before));
  } else {
    std::snprintf(text.data(), text.size(), "smallest error ellipsoid: log det %.3f, before: %.3f",
                  best.value, decision.value_before);
  }
  return text.data() + (options.flight_time_cost ? std::string(", best gain per second") : std::string()) +
         total + refused_words(decision.candidates.refused);
}

std::vector<double> mean_nlos(const std::vector<Sights>& sights, std::size_t size) {
  if (std::ranges::all_of(sights, &Sights::all_clear)) return {};
  std::vector<double> out(size, 0.0);
  for (const Sights& one : sights) {
    for (std::size_t i = 0; i < size; ++i) out[i] += one[i].value_or(1) / static_cast<double>(sights.size());
  }
  return out;
}

void score_by_time(Decision& decision) {
  Candidates& all = decision.candidates;
  all.scored.resize(all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    const double flight_s = all.flight_s(i);
    all.scored[i] = flight_s > 0 ? (all.value[i] - decision.value_before) / flight_s : all.value[i];
  }
}

bool none_can_be_chosen(const Candidates& all) {
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (!all.refused.any(i) && std::isfinite(all.value[i])) return false;
  }
  return true;
}

/// The lowest score; among equal ones the first.
std::optional<std::size_t> lowest_score(const Candidates& all) {
  std::optional<std::size_t> chosen;
  const auto& scores = all.scored.empty() ? all.value : all.scored;
  double below = k_infinity;
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (!(scores[i] < below) || all.refused.any(i) || !std::isfinite(scores[i])) continue;
    below = scores[i] - k_tie * std::max(1e-6, std::abs(scores[i]));
    chosen = i;
  }
  return chosen;
}

}  // namespace

Result<void> NextPointOptions::check() const {
  const auto bad = [](const char* text) { return make_error(Errc::invalid_argument, text); };
  if (dims != 2 && dims != 3) return bad("dims must be 2 or 3");
  if (!(visited_share >= 0 && visited_share <= 1)) return bad("visited_share must be 0 to 1");
  if (max_range_m && !(*max_range_m > 0)) return bad("max_range_m must be positive");
  if (!(los_sigma_m > 0) || !(nlos_sigma_m > 0) || !(position_sigma_m >= 0))
    return bad("sigmas must be positive");
  if (!(prior_sigma_m > 0) || !(bias_sigma_m > 0)) return bad("prior sigmas must be positive");
  if (!(speed_mps > 0) || !(dwell_s >= 0)) return bad("speed_mps must be positive and dwell_s not negative");
  return boost::outcome_v2::success();
}

Result<Decision> next_point(const NextPointInput& input, const NextPointOptions& options) {
  BOOST_OUTCOME_TRY(options.check());
  BOOST_OUTCOME_TRY(check_input(input));
  const Eigen::Vector3d current =
      input.current.value_or(input.visited.empty() ? Eigen::Vector3d::Zero().eval() : input.visited.back());
  Decision out;
  Candidates& all = out.candidates;
  BOOST_OUTCOME_TRY(all.grid, grid_around(current, options.grid));
  all.from_m = current;
  all.speed_mps = options.speed_mps;
  all.dwell_s = options.dwell_s;
  all.refused = refusals_of(input, options, current, all.grid);

  std::vector<double> weights, before;
  std::vector<Sights> sights;
  for (const auto& anchor : input.anchors) {
    sights.emplace_back(input, all.grid, column_height(options), anchor.places.front().position_m);
    Column column = anchor_column(input, anchor, options, all.grid, false, sights.back());
    before.push_back(column.before);
    all.of_anchor.push_back(std::move(column.with));
    const double need = options.combine == Combine::weighted ? deficit(anchor, options, before.back()) : 1.0;
    weights.push_back(anchor.weight * need);
  }
  out.value_before = combine(before, weights, options.combine);
  all.value = combined(all.of_anchor, weights, options.combine);
  all.expected_nlos = mean_nlos(sights, all.grid.size());
  if (options.flight_time_cost && std::isfinite(out.value_before)) score_by_time(out);

  const bool ridge = options.rule == Rule::dissertation && none_can_be_chosen(all);
  if (ridge) {
    std::vector<std::vector<double>> spread;
    for (std::size_t k = 0; k < input.anchors.size(); ++k)
      spread.push_back(anchor_column(input, input.anchors[k], options, all.grid, true, sights[k]).with);
    all.scored = combined(spread, weights, options.combine);
  }
  out.chosen = lowest_score(all);
  out.reason = words(out, options, ridge);
  return out;
}

}  // namespace anchord::planning
