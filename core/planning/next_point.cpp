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

namespace anchord::planning {
namespace {

constexpr double k_infinity = std::numeric_limits<double>::infinity();
constexpr double k_tie = 1e-9;  // relative; mirrored candidates differ by rounding only

/// One column of values over the grid, and the value before.
struct Column {
  double before{};
  std::vector<double> with;
};

bool out_of_range(const NextPointOptions& options, const Eigen::Vector3d& point,
                  const Eigen::Vector3d& place) {
  return options.max_range_m && (point - place).norm() > *options.max_range_m;
}

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

/// By the walls of the bounds and by those that a person accepted; nothing where these let nothing through.
std::optional<double> expected_nlos(const NextPointInput& input, const Eigen::Vector3d& point,
                                    const Eigen::Vector3d& place) {
  const double drawn = p_nlos_through(input.bounds, point, place);
  if (!input.walls || input.walls->empty()) return drawn;
  const double loss_db = obstruction_between(*input.walls, point, place).loss_db;
  if (loss_db > k_opaque_db) return std::nullopt;
  return 1.0 - (1.0 - drawn) * (1.0 - p_nlos_of_loss(loss_db));
}

Column informations(const NextPointInput& input, const PlannedAnchor& anchor, const Place& place,
                    const NextPointOptions& options, const Grid& grid) {
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
    const auto nlos = out_of_range(options, point, place.position_m)
                          ? std::nullopt
                          : expected_nlos(input, point, place.position_m);
    out.with.push_back(nlos ? base.with(point, *nlos) : out.before);
  }
  return out;
}

/// Expectation over the places an anchor may be at.
Column anchor_column(const NextPointInput& input, const PlannedAnchor& anchor,
                     const NextPointOptions& options, const Grid& grid, bool ridge) {
  Column out{0, std::vector<double>(grid.size(), 0.0)};
  double total = 0;
  for (const auto& place : anchor.places) total += place.probability;
  for (const auto& place : anchor.places) {
    Column one;
    if (options.rule != Rule::dissertation) {
      one = informations(input, anchor, place, options, grid);
    } else if (options.dims == 2) {
      one = ridge ? ridge_traces<2>(input, anchor, place, grid)
                  : traces<2>(input, anchor, place, options, grid);
    } else {
      one = ridge ? ridge_traces<3>(input, anchor, place, grid)
                  : traces<3>(input, anchor, place, options, grid);
    }
    const double share = place.probability / total;
    if (share == 0) continue;
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

std::optional<Refusal> refuse(const NextPointInput& input, const NextPointOptions& options,
                              const Eigen::Vector3d& current, const Eigen::Vector3d& point) {
  const auto near = [&](const Eigen::Vector3d& other) {
    Eigen::Vector3d d = (point - other).cwiseAbs();
    d.head<2>() /= options.grid.step_m;
    d.z() /= options.grid.step_up_m;
    return d.maxCoeff() < options.visited_share;
  };
  if (std::any_of(input.unreachable.begin(), input.unreachable.end(), near)) return Refusal::unreachable;
  if (near(current) || std::any_of(input.visited.begin(), input.visited.end(), near)) return Refusal::visited;
  if (const auto why = refuse_point(input.bounds, point)) return why;
  if (const auto why = refuse_path(input.bounds, current, point)) return why;
  bool all_over = true;
  for (const auto& anchor : input.anchors) {
    for (const auto& place : anchor.places) {
      if (options.dims == 2 ? (point - place.position_m).head<2>().norm() <= k_min_distance_m
                            : (point - place.position_m).norm() <= k_min_distance_m) {
        return Refusal::on_anchor;
      }
      all_over = all_over && out_of_range(options, point, place.position_m);
    }
  }
  if (all_over) return Refusal::over_range;
  return std::nullopt;
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

std::string refused_words(const std::vector<CandidateValue>& candidates) {
  std::map<std::string_view, int> counts;
  for (const auto& c : candidates) {
    if (c.refused) ++counts[to_string(*c.refused)];
  }
  std::string out;
  for (const auto& [why, n] : counts)
    out += (out.empty() ? "" : ", ") + std::to_string(n) + " " + std::string(why);
  return out.empty() ? "none rejected" : "refused: " + out;
}

std::string words(const Decision& decision, const NextPointOptions& options, bool ridge) {
  const std::string total = "; " + std::to_string(decision.candidates.size()) + " candidates, ";
  if (!decision.chosen) return "nowhere to go" + total + refused_words(decision.candidates);
  const auto& best = decision.candidates[*decision.chosen];
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
         total + refused_words(decision.candidates);
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
  BOOST_OUTCOME_TRY(const auto grid, grid_around(current, options.grid));

  std::vector<Column> columns;
  std::vector<double> weights, before;
  for (const auto& anchor : input.anchors) {
    columns.push_back(anchor_column(input, anchor, options, grid, false));
    before.push_back(columns.back().before);
    const double need = options.combine == Combine::weighted ? deficit(anchor, options, before.back()) : 1.0;
    weights.push_back(anchor.weight * need);
  }

  Decision out;
  out.value_before = combine(before, weights, options.combine);
  bool any_finite = false;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    CandidateValue c;
    c.point_m = grid.at(i);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      c.per_anchor.push_back(columns[k].with[i]);
      c.p_nlos += expected_nlos(input, c.point_m, input.anchors[k].places.front().position_m).value_or(1) /
                  static_cast<double>(columns.size());
    }
    c.value = combine(c.per_anchor, weights, options.combine);
    c.flight_s = (c.point_m - current).norm() / options.speed_mps + options.dwell_s;
    const bool by_time = options.flight_time_cost && std::isfinite(out.value_before) && c.flight_s > 0;
    c.score = by_time ? (c.value - out.value_before) / c.flight_s : c.value;
    c.refused = refuse(input, options, current, c.point_m);
    any_finite = any_finite || (!c.refused && std::isfinite(c.value));
    out.candidates.push_back(std::move(c));
  }

  const bool ridge = !any_finite && options.rule == Rule::dissertation;
  if (ridge) {
    std::vector<Column> spread;
    for (const auto& anchor : input.anchors)
      spread.push_back(anchor_column(input, anchor, options, grid, true));
    for (std::size_t i = 0; i < grid.size(); ++i) {
      std::vector<double> values;
      for (const auto& column : spread) values.push_back(column.with[i]);
      out.candidates[i].score = combine(values, weights, options.combine);
    }
  }

  double best = k_infinity;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const auto& c = out.candidates[i];
    if (c.refused || !std::isfinite(c.score)) continue;
    if (!out.chosen || c.score < best - k_tie * std::max(1e-6, std::abs(best))) {
      best = c.score;
      out.chosen = i;
    }
  }
  out.reason = words(out, options, ridge);
  return out;
}

}  // namespace anchord::planning
