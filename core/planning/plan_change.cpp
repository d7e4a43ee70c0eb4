#include "core/planning/plan_change.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace anchord::planning {
namespace {

constexpr double k_same_m = 0.005;      ///< a degree's last decimals
constexpr double k_farthest_m = 15;     ///< of a waypoint that was moved, and not another one
constexpr double k_degree_m = 111'195;  ///< of latitude, on a sphere: what is compared is near

double apart_m(const PlanWaypoint& a, const PlanWaypoint& b) {
  const double north = (b.at.lat_deg - a.at.lat_deg) * k_degree_m;
  const double east =
      (b.at.lon_deg - a.at.lon_deg) * k_degree_m * std::cos(a.at.lat_deg * std::numbers::pi / 180);
  return std::hypot(north, east, b.height_m - a.height_m);
}

/// Of calling `b` what became of `a`; removing and adding cost 1 each.
double cost(const PlanWaypoint& a, const PlanWaypoint& b) {
  if (same_waypoint(a, b)) return 0;
  const double m = apart_m(a, b);
  return m > k_farthest_m ? 3 : 0.5 + m / k_farthest_m;
}

/// Pairs of indices, absent where there is no other; by the least cost of all (Wagner and Fischer 1974).
std::vector<std::pair<std::optional<std::size_t>, std::optional<std::size_t>>> paired(
    const std::vector<PlanWaypoint>& a, const std::vector<PlanWaypoint>& b) {
  const std::size_t width = b.size() + 1;
  std::vector<double> best((a.size() + 1) * width);
  for (std::size_t i = 0; i <= a.size(); ++i) {
    for (std::size_t j = 0; j < width; ++j) {
      double& here = best[i * width + j];
      if (i == 0 || j == 0) {
        here = static_cast<double>(i + j);
        continue;
      }
      here = std::min({best[(i - 1) * width + j] + 1, best[i * width + j - 1] + 1,
                       best[(i - 1) * width + j - 1] + cost(a[i - 1], b[j - 1])});
    }
  }
  std::vector<std::pair<std::optional<std::size_t>, std::optional<std::size_t>>> out;
  std::size_t i = a.size(), j = b.size();
  while (i > 0 || j > 0) {
    const double here = best[i * width + j];
    if (i > 0 && j > 0 && here == best[(i - 1) * width + j - 1] + cost(a[i - 1], b[j - 1]))
      out.emplace_back(--i, --j);
    else if (i == 0 || (j > 0 && here == best[i * width + j - 1] + 1))
      out.emplace_back(std::nullopt, --j);
    else
      out.emplace_back(--i, std::nullopt);
  }
  std::reverse(out.begin(), out.end());
  return out;
}

void compare_area(AreaKind area, const GeoPolygon& before, const GeoPolygon& after,
                  std::vector<AreaChange>& out) {
  if (before == after) return;
  out.push_back({area,
                 before.empty()  ? Changed::added
                 : after.empty() ? Changed::removed
                                 : Changed::moved,
                 {},
                 {}});
}

/// No-fly areas that are in both are the same ones, wherever in the list; of the rest, the n-th became the
/// n-th.
void compare_no_fly(const Plan& before, const Plan& after, std::vector<AreaChange>& out) {
  const auto missing = [](const std::vector<GeoPolygon>& from, const std::vector<GeoPolygon>& in) {
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < from.size(); ++i)
      if (std::ranges::find(in, from[i]) == in.end()) indices.push_back(i);
    return indices;
  };
  const auto gone = missing(before.no_fly, after.no_fly), come = missing(after.no_fly, before.no_fly);
  for (std::size_t i = 0; i < std::max(gone.size(), come.size()); ++i) {
    const auto b = i < gone.size() ? std::optional(gone[i]) : std::nullopt;
    const auto a = i < come.size() ? std::optional(come[i]) : std::nullopt;
    out.push_back({AreaKind::no_fly, !b ? Changed::added : !a ? Changed::removed : Changed::moved, b, a});
  }
}

std::vector<NetworkId> not_in(const std::vector<NetworkId>& of, const std::vector<NetworkId>& in) {
  std::vector<NetworkId> out;
  for (const auto id : of)
    if (std::ranges::find(in, id) == in.end()) out.push_back(id);
  return out;
}

using Targets = std::map<NetworkId, double>;
std::vector<TargetChange> changed_targets(const Targets& before, const Targets& after) {
  const auto of = [](const Targets& targets, NetworkId anchor) {
    const auto it = targets.find(anchor);
    return it == targets.end() ? std::nullopt : std::optional(it->second);
  };
  Targets either = before;
  either.insert(after.begin(), after.end());
  std::vector<TargetChange> out;
  for (const auto& [anchor, ignored] : either) {
    const auto was_m = of(before, anchor), is_m = of(after, anchor);
    if (was_m != is_m) out.push_back({anchor, was_m, is_m});
  }
  return out;
}

}  // namespace

bool same_waypoint(const PlanWaypoint& a, const PlanWaypoint& b) {
  return a.at == b.at && a.height_m == b.height_m && a.heading_deg == b.heading_deg &&
         a.dwell_s == b.dwell_s && a.measure == b.measure && a.turn == b.turn &&
         a.height_search == b.height_search;
}

PlanChange plan_change(const Plan& before, const Plan& after, std::size_t flown) {
  PlanChange out;
  for (const auto& [b, a] : paired(before.waypoints, after.waypoints)) {
    if (b && a && *b < flown) out.next = *a + 1;
    if (!b || !a) {
      out.waypoints.push_back({b ? Changed::removed : Changed::added, b, a, 0});
      continue;
    }
    if (same_waypoint(before.waypoints[*b], after.waypoints[*a])) continue;
    const double m = apart_m(before.waypoints[*b], after.waypoints[*a]);
    out.waypoints.push_back({m > k_same_m ? Changed::moved : Changed::altered, b, a, m});
  }
  compare_area(AreaKind::outline, before.outline, after.outline, out.areas);
  compare_area(AreaKind::fence, before.fence, after.fence, out.areas);
  compare_no_fly(before, after, out.areas);
  out.anchors_added = not_in(after.expected_anchors, before.expected_anchors);
  out.anchors_removed = not_in(before.expected_anchors, after.expected_anchors);
  out.targets = changed_targets(before.anchor_target_sigma_m, after.anchor_target_sigma_m);
  return out;
}

}  // namespace anchord::planning
