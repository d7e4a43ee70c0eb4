#include "core/planning/flight_plan.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <tuple>
#include <utility>

#include "core/base/cross.hpp"
#include "core/planning/design.hpp"
#include "core/planning/route.hpp"

namespace anchord::planning {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double k_unreachable_m = std::numeric_limits<double>::infinity();
/// The ring lies so far beyond the keep-out that the chords round a corner, 3 m apart, stay outside it.
constexpr double k_ring_margin_m = 0.35;
/// A building has room for an anchor where a grid of this finds none inside it: there is none.
constexpr double k_finest_grid_m = 0.1;

struct Candidate {
  Vector3d point_m;
  double along{};  ///< place round the building, 0..1
};

/// A grid inside the outline. What nothing outside can range is counted and left out: it cannot be found
/// whatever is flown, and would drown the others in the mean.
std::vector<Vector3d> assumed_anchors(const FlightPlanInput& input, const FlightPlanOptions& options,
                                      const std::vector<Candidate>& all, std::size_t& n_out_of_range) {
  Vector2d low{k_unreachable_m, k_unreachable_m}, high{-k_unreachable_m, -k_unreachable_m};
  for (const auto& corner : input.outline) {
    low = low.cwiseMin(corner);
    high = high.cwiseMax(corner);
  }
  std::vector<double> heights;
  for (double z = 2.5; z < std::max(input.building_height_m, 2.6); z += options.floor_m) heights.push_back(z);
  const double reach_m = options.max_range_m - options.keep_out_m;
  std::vector<Vector3d> points;
  for (const auto& c : all) points.push_back(c.point_m);
  std::vector<Vector3d> out;
  // A large hall gets a wider grid, not more anchors; a narrow or slanted one a finer grid until a place lies
  // inside.
  double spacing = options.anchor_spacing_m, wider = 1.3;
  for (;; spacing *= wider) {
    out.clear();
    n_out_of_range = 0;
    const auto count = [&](double length) {
      return std::max(1, static_cast<int>(std::round(length / spacing)));
    };
    const int nx = count(high.x() - low.x()), ny = count(high.y() - low.y());
    std::vector<Vector3d> near;
    for (int iy = 0; iy < ny; ++iy) {
      for (int ix = 0; ix < nx; ++ix) {
        const Vector2d p = low + Vector2d((ix + 0.5) / nx, (iy + 0.5) / ny).cwiseProduct(high - low);
        if (!contains(input.outline, p)) continue;
        const bool far = distance_to_edge_m(input.outline, p) > reach_m;
        if (far) n_out_of_range += heights.size();
        for (const double z : heights) {
          if (!far) near.push_back({p.x(), p.y(), z});
        }
      }
    }
    const bool too_many = static_cast<int>(near.size()) > options.max_anchors && nx * ny > 1;
    if (too_many && wider > 1) continue;
    if (near.empty() && n_out_of_range == 0 && spacing > k_finest_grid_m) {
      wider = 0.5;
      continue;
    }
    for (const auto& anchor : near) {
      if (in_range(anchor, points, options.max_range_m))
        out.push_back(anchor);
      else
        ++n_out_of_range;
    }
    return out;
  }
}

std::vector<Candidate> candidates(const FlightPlanInput& input, const FlightPlanOptions& options,
                                  const Bounds& bounds) {
  std::vector<double> heights = options.heights_m;
  if (heights.empty())
    heights = {2.0, std::max(3.0, input.building_height_m * 0.6), input.building_height_m + 1.0};
  std::vector<Candidate> out;
  for (const double extra : options.ring_m) {
    const auto ring =
        ring_around(input.outline, options.keep_out_m + k_ring_margin_m + extra, options.spacing_m);
    for (std::size_t i = 0; i < ring.size(); ++i) {
      for (const double z : heights) {
        const Candidate c{{ring[i].x(), ring[i].y(), z},
                          static_cast<double>(i) / static_cast<double>(ring.size())};
        const bool near_fence = bounds.fence.size() >= 3 &&
                                distance_to_edge_m(bounds.fence, c.point_m.head<2>()) < k_fence_margin_m;
        if (!near_fence && !refuse_point(bounds, c.point_m)) out.push_back(c);
      }
    }
  }
  return out;
}

using CandidateSights = std::vector<std::vector<Sight>>;  // by candidate

/// Best candidate not yet chosen, and the value with it.
std::pair<std::size_t, double> best_of(const Design& design, const CandidateSights& all,
                                       const std::vector<bool>& chosen) {
  std::pair<std::size_t, double> best{all.size(), k_unreachable_m};
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (chosen[i]) continue;
    const double value = design.value_with(all[i]);
    if (value < best.second) best = {i, value};
  }
  return best;
}

std::vector<std::size_t> choose(Design& design, const CandidateSights& all, const FlightPlanOptions& options,
                                std::string& reason) {
  std::vector<bool> chosen(all.size(), false);
  std::vector<std::size_t> out;
  const auto most = std::min(static_cast<std::size_t>(options.max_points), all.size());
  reason = "the largest number of points";
  while (out.size() < most) {
    const double before = design.mean_square_m2();
    const auto [next, value] = best_of(design, all, chosen);
    if (next == all.size()) break;
    design.add(all[next]);
    const double gain = 1 - design.mean_square_m2() / before;
    if (static_cast<int>(out.size()) >= options.min_points && gain < options.min_gain) {
      design.remove(all[next]);
      std::array<char, 128> text{};
      std::snprintf(text.data(), text.size(),
                    "one more point would lower the predicted squared error by only %.1f %%", 100 * gain);
      reason = text.data();
      break;
    }
    chosen[next] = true;
    out.push_back(next);
  }
  // Exchange: what was best early need not be best among the others.
  for (int pass = 0; pass < 3; ++pass) {
    bool changed = false;
    for (auto& point : out) {
      const double before = design.value();
      design.remove(all[point]);
      chosen[point] = false;
      const auto [next, value] = best_of(design, all, chosen);
      if (next < all.size() && value < before - 1e-6 * std::abs(before)) {
        point = next;
        changed = true;
      }
      design.add(all[point]);
      chosen[point] = true;
    }
    if (!changed) break;
  }
  return out;
}

/// Points between two that no straight way joins: along the inner ring, each as far as can be seen, the
/// shorter way round. Empty when there is none.
std::vector<Vector3d> way_round(const std::vector<Candidate>& ring, const Bounds& bounds,
                                const Vector3d& from, const Vector3d& to) {
  const double height = std::max(from.z(), to.z());
  const int n = static_cast<int>(ring.size());
  std::vector<Vector3d> best;
  double best_m = k_unreachable_m;
  for (int start = 0; start < n; ++start) {
    const auto at = [&](int i) {
      const Vector3d& p = ring[static_cast<std::size_t>(((i % n) + n) % n)].point_m;
      return Vector3d(p.x(), p.y(), height);
    };
    if (refuse_path(bounds, from, at(start))) continue;
    for (const int direction : {1, -1}) {
      std::vector<Vector3d> way{at(start)};
      double length = (at(start) - from).norm();
      int here = start;
      for (int walked = 0; walked < n && length < best_m && refuse_path(bounds, way.back(), to);) {
        int step = 0;
        for (int k = 1; k <= n - walked && !refuse_path(bounds, way.back(), at(here + direction * k)); ++k)
          step = k;
        if (step == 0) break;
        here += direction * step;
        walked += step;
        length += (at(here) - way.back()).norm();
        way.push_back(at(here));
      }
      length += (to - way.back()).norm();
      if (length < best_m && !refuse_path(bounds, way.back(), to)) {
        best = way;
        best_m = length;
      }
    }
  }
  return best;
}

/// Of the area, not of the corners: a finely drawn side does not draw it near.
Vector2d centroid(const Polygon& outline) {
  const Vector2d base = outline.front();
  Vector2d sum{0, 0};
  double twice_area_m2 = 0;
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector2d a = outline[i] - base, b = outline[(i + 1) % outline.size()] - base;
    twice_area_m2 += cross(a, b);
    sum += cross(a, b) * (a + b);
  }
  return base + sum / (3 * twice_area_m2);
}

Result<void> order(FlightPlan& plan, std::vector<Candidate> chosen, const FlightPlanInput& input,
                   const FlightPlanOptions& options, const Bounds& bounds) {
  std::sort(chosen.begin(), chosen.end(), [](const Candidate& a, const Candidate& b) {
    return std::tuple(a.along, a.point_m.z(), a.point_m.x()) <
           std::tuple(b.along, b.point_m.z(), b.point_m.x());
  });
  const Vector2d middle = centroid(input.outline);
  std::vector<Candidate> ring;
  for (const auto& p : ring_around(input.outline, options.keep_out_m + k_ring_margin_m, options.spacing_m)) {
    const Candidate c{{p.x(), p.y(), bounds.min_height_m.value_or(0)}, 0};
    if (!refuse_point(bounds, c.point_m)) ring.push_back(c);
  }
  const auto put = [&](const Vector3d& p, bool measure) {
    const Vector2d look = middle - p.head<2>();
    plan.waypoints.push_back({p, measure, std::atan2(look.x(), look.y())});
  };
  for (std::size_t i = 0; i < chosen.size(); ++i) {
    const Vector3d &from = chosen[i].point_m, &to = chosen[(i + 1) % chosen.size()].point_m;
    put(from, true);
    if (!refuse_path(bounds, from, to)) continue;
    auto way = way_round(ring, bounds, from, to);
    if (way.empty()) {
      const auto any = route(bounds, from, to);
      if (!any) {
        return make_error(
            Errc::not_found,
            "no permitted path joins two points of the flight: widen the fence or reduce the clearance");
      }
      way.assign(any->begin(), any->end() - 1);
    }
    for (const auto& p : way) put(p, false);
  }
  for (std::size_t i = 0; i < plan.waypoints.size(); ++i) {
    plan.length_m +=
        (plan.waypoints[(i + 1) % plan.waypoints.size()].point_m - plan.waypoints[i].point_m).norm();
  }
  plan.n_measure = chosen.size();
  plan.duration_s = plan.length_m / options.speed_mps + static_cast<double>(chosen.size()) * options.dwell_s;
  return boost::outcome_v2::success();
}

/// Outside the convex hull of the outline: all of it lies to the left of one of its corners, seen from there.
bool round_the_building(const Polygon& outline, const Vector2d& p) {
  return std::ranges::any_of(outline, [&](const Vector2d& corner) {
    return std::ranges::all_of(outline,
                               [&](const Vector2d& other) { return cross(corner - p, other - p) >= 0; });
  });
}

/// By candidate, the number of its part: those of one part are joined by permitted paths.
std::vector<std::size_t> parts_of(const std::vector<Candidate>& all, const Bounds& bounds) {
  const std::size_t none = all.size();
  std::vector<std::size_t> part(all.size(), none), first;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (part[i] != none) continue;
    for (std::size_t k = 0; k < first.size() && part[i] == none; ++k)
      if (route(bounds, all[first[k]].point_m, all[i].point_m)) part[i] = k;
    if (part[i] == none) {
      part[i] = first.size();
      first.push_back(i);
    }
    // All that is seen from there, and from what is seen: a route is looked for once a part, not once a
    // candidate.
    std::vector<std::size_t> open{i};
    while (!open.empty()) {
      const auto here = open.back();
      open.pop_back();
      for (std::size_t j = 0; j < all.size(); ++j) {
        if (part[j] != none || refuse_path(bounds, all[here].point_m, all[j].point_m)) continue;
        part[j] = part[i];
        open.push_back(j);
      }
    }
  }
  return part;
}

/// The candidates of one part of what may be flown, for no permitted path leads to the others: of the part
/// with most places round the building, for the aircraft comes from there and not from a courtyard; where a
/// fence leaves none, of the largest.
std::vector<Candidate> reachable(std::vector<Candidate> all, const FlightPlanInput& input,
                                 const Bounds& bounds) {
  const auto part = parts_of(all, bounds);
  std::map<std::size_t, std::pair<int, int>> size;  // round the building, in all
  for (std::size_t i = 0; i < all.size(); ++i) {
    auto& [outside, in_all] = size[part[i]];
    if (round_the_building(input.outline, all[i].point_m.head<2>())) ++outside;
    ++in_all;
  }
  const auto chosen = std::ranges::max_element(size, {}, [](const auto& s) { return s.second; })->first;
  std::vector<Candidate> out;
  for (std::size_t i = 0; i < all.size(); ++i)
    if (part[i] == chosen) out.push_back(all[i]);
  return out;
}

}  // namespace

bool in_range(const Vector3d& anchor, const std::vector<Vector3d>& points_m, double max_range_m) {
  constexpr int k_needed = 4;
  int seen = 0;
  for (const auto& p : points_m) {
    if ((p - anchor).norm() <= max_range_m && ++seen >= k_needed) return true;
  }
  return false;
}

std::string left_out_text(std::size_t n_unreachable) {
  return std::to_string(n_unreachable) +
         " places that no permitted path leads to (a courtyard, a pocket between no-fly areas) are left out";
}

Result<void> FlightPlanOptions::check() const {
  const auto bad = [](const char* text) { return make_error(Errc::invalid_argument, text); };
  if (!(keep_out_m > 0 && keep_out_m <= 100)) return bad("keep_out_m must be above 0 and at most 100");
  if (rule == Rule::dissertation)
    return bad("rule dissertation chooses single points only: for a whole flight use a_optimal or d_optimal");
  if (ring_m.empty()) return bad("ring_m must name at least one ring");
  for (const double m : ring_m) {
    if (!(m >= 0 && m <= 200)) return bad("ring_m must be 0 to 200");
  }
  for (const double m : heights_m) {
    if (!(m > 0 && m <= 200)) return bad("heights_m must be above 0 and at most 200");
  }
  if (!(spacing_m >= 0.5) || !(anchor_spacing_m >= 0.5)) return bad("spacings must be at least 0.5 m");
  if (!(floor_m >= 2) || max_anchors < 1) return bad("floor_m must be at least 2 and max_anchors at least 1");
  if (!(max_range_m > 0)) return bad("max_range_m must be positive");
  if (min_points < 4 || max_points < min_points || max_points > 500)
    return bad("need 4 <= min_points <= max_points <= 500");
  if (!(min_gain >= 0 && min_gain < 1)) return bad("min_gain must be 0 to 1");
  if (!(wall_excess_m >= 0) || !(roof_walls >= 0))
    return bad("wall_excess_m and roof_walls must not be negative");
  if (ranges_per_point < 1 || !(range_sigma_m > 0) || !(point_sigma_m >= 0) || !(prior_sigma_m > 0) ||
      !(bias_sigma_m > 0)) {
    return bad("ranges_per_point and sigmas must be positive");
  }
  if (!(speed_mps > 0) || !(dwell_s >= 0)) return bad("speed_mps must be positive and dwell_s not negative");
  return boost::outcome_v2::success();
}

Result<FlightPlan> plan_flight(const FlightPlanInput& input, const FlightPlanOptions& options) {
  BOOST_OUTCOME_TRY(options.check());
  if (input.outline.size() < 3)
    return make_error(Errc::invalid_argument, "an outline needs at least three corners");
  for (const auto& corner : input.outline) {
    if (!corner.allFinite() || corner.norm() > k_furthest_corner_m) {
      return make_error(Errc::invalid_argument, "a corner of the outline is more than 2 km from its middle");
    }
  }
  if (crosses_itself(input.outline))
    return make_error(Errc::invalid_argument,
                      "the outline crosses itself: give its corners in order round it");
  double twice_area_m2 = 0;
  for (std::size_t i = 0; i < input.outline.size(); ++i) {
    const auto &a = input.outline[i], &b = input.outline[(i + 1) % input.outline.size()];
    twice_area_m2 += a.x() * b.y() - a.y() * b.x();
  }
  if (std::abs(twice_area_m2) < 2)
    return make_error(Errc::invalid_argument, "the outline encloses less than 1 m^2");
  Bounds bounds;
  bounds.fence = input.fence;
  bounds.no_fly = input.no_fly;
  bounds.no_fly.push_back(input.outline);
  bounds.keep_out_m = options.keep_out_m;

  FlightPlan plan;
  auto all = candidates(input, options, bounds);
  const auto n_permitted = all.size();
  if (!all.empty()) all = reachable(std::move(all), input, bounds);
  plan.n_candidates = all.size();
  plan.n_unreachable = n_permitted - all.size();
  if (static_cast<int>(all.size()) < options.min_points) {
    return make_error(Errc::not_found,
                      "only " + std::to_string(all.size()) +
                          " points to fly to are left by fence, no-fly areas and clearance" +
                          (plan.n_unreachable > 0 ? ", and no permitted path leads to " +
                                                        std::to_string(plan.n_unreachable) + " others"
                                                  : std::string()) +
                          ": need " + std::to_string(options.min_points));
  }
  plan.assumed_anchors_m = assumed_anchors(input, options, all, plan.n_out_of_range);
  if (plan.assumed_anchors_m.empty() && plan.n_out_of_range == 0)
    return make_error(Errc::invalid_argument, "the outline encloses no area");
  if (plan.assumed_anchors_m.empty()) {
    return make_error(Errc::not_found, "nothing inside the outline is within " +
                                           std::to_string(std::lround(options.max_range_m)) +
                                           " m of where the aircraft may fly");
  }
  Design design(plan.assumed_anchors_m, options, {input.outline, input.building_height_m, input.walls});
  CandidateSights sights;
  for (const auto& c : all) sights.push_back(design.sights(c.point_m));
  std::vector<Candidate> chosen;
  for (const auto i : choose(design, sights, options, plan.reason)) chosen.push_back(all[i]);
  BOOST_OUTCOME_TRYV(order(plan, std::move(chosen), input, options, bounds));
  if (plan.n_unreachable > 0) {
    plan.reason += "; " + left_out_text(plan.n_unreachable);
  }
  plan.predicted_sigma_m = design.sigmas_m();
  plan.rms_m = std::sqrt(design.mean_square_m2());
  plan.worst_m = *std::max_element(plan.predicted_sigma_m.begin(), plan.predicted_sigma_m.end());
  if (plan.n_out_of_range > 0) {
    plan.reason += "; " + std::to_string(plan.n_out_of_range) +
                   " places inside are out of range from everywhere and not counted";
  }
  return plan;
}

}  // namespace anchord::planning
