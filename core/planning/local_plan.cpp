#include "core/planning/local_plan.hpp"

#include "core/planning/flight_time.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <utility>

#include "core/geo/enu.hpp"
#include "core/planning/design.hpp"
#include "core/planning/gdop.hpp"

namespace anchord::planning {
namespace {

/// Measuring points that differ less are as good as in one plane.
constexpr double k_one_height_m = 0.5;

std::string with_numbers(const char* format, double a, double b = 0, double c = 0) {
  std::array<char, 240> out{};
  std::snprintf(out.data(), out.size(), format, a, b, c);
  return out.data();
}

FlightPlanOptions flight_options(const Plan& plan) {
  FlightPlanOptions o;
  o.keep_out_m = plan.settings.keep_out_m;
  o.speed_mps = plan.settings.speed_mps;
  o.dwell_s = plan.settings.dwell_s;
  o.ranges_per_point = plan.settings.samples;
  // The rule of the dissertation weighs one more point against those before: a whole flight has none yet.
  if (plan.settings.rule != Rule::dissertation) o.rule = plan.settings.rule;
  return o;
}

/// 2 m, mid-height and 1 m above the roof, as far as the band allows.
std::vector<double> heights_of(const Plan& plan) {
  const auto& s = plan.settings;
  std::vector<double> out;
  for (const double wanted : {2.0, plan.building_height_m / 2, plan.building_height_m + 1}) {
    const double height = std::clamp(wanted, s.min_height_m, s.max_height_m);
    if (std::none_of(out.begin(), out.end(), [&](double h) { return std::abs(h - height) < 0.5; })) {
      out.push_back(height);
    }
  }
  return out;
}

std::vector<Eigen::Vector3d> anchors_inside(const LocalPlan& plan, const FlightPlanOptions& options,
                                            double height_m) {
  std::vector<Eigen::Vector3d> out;
  if (plan.outline.size() < 3) return out;
  Eigen::Vector2d low = plan.outline[0], high = plan.outline[0];
  for (const auto& c : plan.outline) {
    low = low.cwiseMin(c);
    high = high.cwiseMax(c);
  }
  // Of a large outline all but max_anchors are left out again: a wider grid, or it is the number of its
  // places that takes minutes.
  const double most_places = 64.0 * options.max_anchors;
  const Eigen::Vector2d size_m = high - low;
  const double spacing_m =
      std::max(options.anchor_spacing_m, std::sqrt(size_m.x() * size_m.y() / most_places));
  for (double up = std::min(2.5, height_m / 2); up < height_m; up += options.floor_m) {
    for (double x = low.x() + 1; x < high.x(); x += spacing_m) {
      for (double y = low.y() + 1; y < high.y(); y += spacing_m) {
        if (contains(plan.outline, {x, y})) out.emplace_back(x, y, up);
      }
    }
  }
  while (out.size() > static_cast<std::size_t>(options.max_anchors)) {
    std::vector<Eigen::Vector3d> half;
    for (std::size_t i = 0; i < out.size(); i += 2) half.push_back(out[i]);
    out = std::move(half);
  }
  return out;
}

void predict(const Plan& plan, const LocalPlan& local, PlanCheck& check) {
  const auto options = flight_options(plan);
  std::vector<Eigen::Vector3d> measured;
  for (std::size_t i = 0; i < local.waypoints_m.size(); ++i)
    if (plan.waypoints[i].measure) measured.push_back(local.waypoints_m[i]);
  check.assumed_anchors_m = anchors_inside(local, options, plan.building_height_m);
  // Of fewer than four points in all there is a warning of its own.
  if (measured.size() >= 4)
    check.n_out_of_range = std::erase_if(check.assumed_anchors_m, [&](const Eigen::Vector3d& anchor) {
      return !in_range(anchor, measured, options.max_range_m);
    });
  if (check.assumed_anchors_m.empty() || check.n_measure == 0) {
    check.assumed_anchors_m.clear();
    return;
  }
  Design design(check.assumed_anchors_m, options, {local.outline, plan.building_height_m, local.walls});
  for (const auto& point : measured) design.add(point);
  check.predicted_sigma_m = design.sigmas_m();
  for (const auto& anchor : check.assumed_anchors_m) {
    Geometry<3> geometry(anchor);
    for (const auto& point : measured)
      if ((point - anchor).norm() <= options.max_range_m) geometry.add(point);
    const auto seen = geometry.gdop();
    check.predicted_gdop.push_back(seen ? std::optional(seen.value().root) : std::nullopt);
  }
  check.rms_m = std::sqrt(design.mean_square_m2());
  check.worst_m = *std::max_element(check.predicted_sigma_m.begin(), check.predicted_sigma_m.end());
}

/// Floors of a building have nearly the same outline, and the drawn one often is it: what another covers
/// would only cost time wherever a way is looked for.
void add_building(Polygon outline, LocalPlan& plan) {
  constexpr double k_same_m = 0.1;  // tracing is no better
  const auto within = [&](const Polygon& outer) { return covers(outer, outline, k_same_m); };
  if (within(plan.outline) || std::ranges::any_of(plan.buildings, within)) return;
  std::erase_if(plan.buildings, [&](const Polygon& kept) { return covers(outline, kept, k_same_m); });
  plan.buildings.push_back(std::move(outline));
}

std::string point_text(Refusal refusal, const Plan& plan, std::size_t i) {
  const auto& s = plan.settings;
  const std::string who = "waypoint " + std::to_string(i + 1) + " ";
  if (refusal == Refusal::too_low) {
    return who + with_numbers("is %.1f m high, the height band begins at %.1f m", plan.waypoints[i].height_m,
                              s.min_height_m);
  }
  if (refusal == Refusal::too_high) {
    return who + with_numbers("is %.1f m high, the height band ends at %.1f m", plan.waypoints[i].height_m,
                              s.max_height_m);
  }
  if (refusal == Refusal::outside_fence) return who + "lies outside the fence";
  return who + with_numbers("is nearer than %.1f m to the building or a no-fly area", s.keep_out_m);
}

/// What is flown as drawn, and measures less than one would expect.
void check_measuring_points(const Plan& plan, const LocalPlan& local, PlanCheck& check) {
  const auto warn = [&](const char* code, std::string pointer, std::string text) {
    check.issues.push_back({Severity::warning, code, std::move(pointer), std::move(text)});
  };
  double lowest_m = 1e9, highest_m = -1e9;
  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < local.waypoints_m.size(); ++i) {
    const auto& point = local.waypoints_m[i];
    if (local.fence.size() >= 3 && contains(local.fence, point.head<2>()) &&
        distance_to_edge_m(local.fence, point.head<2>()) < k_fence_margin_m - 0.01)
      near.push_back(i);
    if (!plan.waypoints[i].measure) continue;
    lowest_m = std::min(lowest_m, point.z());
    highest_m = std::max(highest_m, point.z());
  }
  if (!near.empty()) {
    std::string which;
    for (std::size_t k = 0; k < near.size() && k < 5; ++k)
      which += (k == 0 ? "" : ", ") + std::to_string(near[k] + 1);
    if (near.size() > 5) which += " and " + std::to_string(near.size() - 5) + " more";
    warn("near_fence", "/waypoints/" + std::to_string(near.front()),
         with_numbers(
             "nearer than %.0f m to the fence, where a gust carries the aircraft over it, which ends the "
             "flight: waypoint ",
             k_fence_margin_m) +
             which);
  }
  if (check.n_measure >= 4 && highest_m - lowest_m < k_one_height_m)
    warn("one_height", "/waypoints",
         with_numbers(
             "all measuring points are between %.1f and %.1f m high: an anchor above them and its mirror "
             "below fit alike. Measure at another height, too",
             lowest_m, highest_m));
  if (check.n_out_of_range > 0)
    warn("over_range", "/outline",
         with_numbers("%.0f of %.0f places inside the outline are within %.0f m of fewer than four measuring "
                      "points: no "
                      "anchor is located there",
                      static_cast<double>(check.n_out_of_range),
                      static_cast<double>(check.n_out_of_range + check.assumed_anchors_m.size()),
                      flight_options(plan).max_range_m));
}

}  // namespace

bool PlanCheck::flyable() const {
  return std::none_of(issues.begin(), issues.end(),
                      [](const PlanIssue& i) { return i.severity == Severity::error; });
}

Result<Wgs84> plan_origin(const Plan& plan) {
  if (plan.origin) return *plan.origin;
  GeoPolygon points = plan.outline;
  if (points.empty()) {
    for (const auto& w : plan.waypoints) points.push_back(w.at);
  }
  if (points.empty()) {
    return make_error(Errc::invalid_argument,
                      "the plan has no origin, no outline and no waypoint: nowhere to fly");
  }
  // Longitudes count from the first one, the short way round: the middle of a plan over the date line is
  // there, and not at Greenwich.
  const double first_deg = points.front().lon_deg;
  Wgs84 middle{};
  for (const auto& p : points) {
    middle.lon_deg += std::remainder(p.lon_deg - first_deg, 360) / static_cast<double>(points.size());
    middle.lat_deg += p.lat_deg / static_cast<double>(points.size());
  }
  middle.lon_deg = std::remainder(first_deg + middle.lon_deg, 360);
  return middle;
}

Result<LocalPlan> local_plan(const Plan& plan) {
  BOOST_OUTCOME_TRY(const auto origin, plan_origin(plan));
  LocalPlan out;
  out.origin = origin;
  const EnuFrame frame(origin);
  const auto metres = [&](const LonLat& p) -> Eigen::Vector2d {
    return frame.enu_from_wgs84({p.lat_deg, p.lon_deg, origin.height_m}).m.head<2>();
  };
  const auto area = [&](const GeoPolygon& polygon) {
    Polygon local;
    for (const auto& corner : polygon) local.push_back(metres(corner));
    return local;
  };
  out.outline = area(plan.outline);
  out.fence = area(plan.fence);
  for (const auto& polygon : plan.no_fly) out.no_fly.push_back(area(polygon));
  if (plan.structure) {
    for (const auto& polygon : plan.structure->outlines) add_building(area(polygon), out);
    auto walls = std::make_shared<std::vector<BuiltWall>>();
    for (const auto& w : plan.structure->walls)
      walls->push_back({metres(w.from), metres(w.to), w.bottom_m, w.top_m, w.thickness_m, w.material});
    out.walls = std::move(walls);
  }
  for (const auto& w : plan.waypoints) {
    const auto at = metres(w.at);
    out.waypoints_m.emplace_back(at.x(), at.y(), w.height_m);
  }
  return out;
}

Bounds flight_bounds(const LocalPlan& plan, const PlanSettings& settings) {
  Bounds bounds;
  bounds.fence = plan.fence;
  bounds.no_fly = plan.no_fly;
  if (plan.outline.size() >= 3) bounds.no_fly.push_back(plan.outline);
  bounds.no_fly.insert(bounds.no_fly.end(), plan.buildings.begin(), plan.buildings.end());
  // Straight ways between points of a ring cut its arcs: plan_flight() allows 20 cm, and 1 cm is rounding.
  bounds.keep_out_m = std::max(0.0, settings.keep_out_m - 0.21);
  bounds.min_height_m = settings.min_height_m;
  bounds.max_height_m = settings.max_height_m;
  return bounds;
}

Result<PlanCheck> check_plan(const Plan& plan) {
  BOOST_OUTCOME_TRY(const auto local, local_plan(plan));
  const Bounds bounds = flight_bounds(local, plan.settings);
  PlanCheck check;
  const auto report = [&](Severity severity, std::string code, std::string pointer, std::string text) {
    check.issues.push_back({severity, std::move(code), std::move(pointer), std::move(text)});
  };
  if (plan.waypoints.empty())
    report(Severity::error, "no_waypoints", "/waypoints", "the plan has no waypoint");
  if (local.fence.empty()) {
    report(Severity::warning, "no_fence", "/fence",
           "no fence is drawn: only the height band and the no-fly areas bound the flight");
  }
  if (local.outline.empty()) {
    report(Severity::warning, "no_outline", "/outline",
           "no outline is drawn: nothing keeps the aircraft away from the building");
  }
  const auto check_ring = [&](const Polygon& ring, const std::string& pointer) {
    if (crosses_itself(ring))
      report(Severity::error, "self_crossing", pointer,
             "it crosses itself: give its corners in order round it");
  };
  check_ring(local.outline, "/outline");
  check_ring(local.fence, "/fence");
  for (std::size_t i = 0; i < local.no_fly.size(); ++i)
    check_ring(local.no_fly[i], "/no_fly/" + std::to_string(i));
  double furthest_m = 0;
  for (const auto& corner : local.outline) furthest_m = std::max(furthest_m, corner.norm());
  if (furthest_m > k_furthest_corner_m) {
    report(Severity::error, "too_far", "/outline",
           with_numbers("a corner of the outline is %.0f m from the origin of the plan, the limit is %.0f m: "
                        "are longitude and latitude swapped, or is the origin another site's?",
                        furthest_m, k_furthest_corner_m));
  }
  for (std::size_t i = 0; i < local.waypoints_m.size(); ++i) {
    const std::string pointer = "/waypoints/" + std::to_string(i);
    const auto& point = local.waypoints_m[i];
    if (const auto refusal = refuse_point(bounds, point)) {
      report(Severity::error, std::string(to_string(*refusal)), pointer, point_text(*refusal, plan, i));
    }
    if (plan.waypoints[i].measure) ++check.n_measure;
    if (i == 0) continue;
    const auto& before = local.waypoints_m[i - 1];
    check.length_m += (point - before).norm();
    if (!refuse_point(bounds, before) && !refuse_point(bounds, point) && refuse_path(bounds, before, point)) {
      report(Severity::error, "path_blocked", pointer,
             "the straight line from waypoint " + std::to_string(i) + " to " + std::to_string(i + 1) +
                 " crosses the building, a no-fly area or the fence");
    }
  }
  check.time = flight_time(local, plan);
  if (const auto& limit = plan.settings.max_flight_s; limit && check.time.low_s > *limit) {
    report(Severity::error, "too_long", "/settings/max_flight_s",
           with_numbers("the flight takes at least %.0f s, the limit is %.0f s", check.time.low_s, *limit));
  } else if (limit && check.time.expected_s > *limit) {
    report(Severity::warning, "time_short", "/settings/max_flight_s",
           with_numbers("the flight is expected to take %.0f s; at the limit of %.0f s it returns unfinished",
                        check.time.expected_s, *limit));
  }
  if (!plan.waypoints.empty() && check.n_measure < 4) {
    report(Severity::warning, "few_points", "/waypoints",
           with_numbers("%.0f measuring points (measure; of an imported plan those with a hold time): a "
                        "position needs at least four that are not in one plane",
                        static_cast<double>(check.n_measure)));
  }
  predict(plan, local, check);
  check_measuring_points(plan, local, check);
  return check;
}

Plan with_waypoints(Plan plan, const FlightPlan& flight, const Wgs84& origin) {
  plan.waypoints.clear();
  const EnuFrame frame(origin);
  for (const auto& w : flight.waypoints) {
    const auto at = frame.wgs84_from_enu(Enu{{w.point_m.x(), w.point_m.y(), 0}});
    PlanWaypoint waypoint;
    waypoint.at = {at.lon_deg, at.lat_deg};
    waypoint.height_m = w.point_m.z();
    waypoint.heading_deg = std::fmod(w.heading_rad * 180 / std::numbers::pi + 360, 360);
    waypoint.measure = w.measure;
    waypoint.turn = w.measure && plan.settings.turn;
    waypoint.height_search = w.measure && plan.settings.height_search;
    plan.waypoints.push_back(waypoint);
  }
  return plan;
}

Result<GeneratedPlan> generate_waypoints(const Plan& plan) {
  if (plan.outline.size() < 3) {
    return make_error(Errc::invalid_argument,
                      "waypoints are made from the building's outline, and the plan has none");
  }
  BOOST_OUTCOME_TRY(const auto local, local_plan(plan));
  FlightPlanInput input{local.outline, plan.building_height_m, local.no_fly, local.fence, local.walls};
  input.no_fly.insert(input.no_fly.end(), local.buildings.begin(), local.buildings.end());
  auto options = flight_options(plan);
  options.heights_m = heights_of(plan);
  BOOST_OUTCOME_TRY(const auto flight, plan_flight(input, options));
  GeneratedPlan out{with_waypoints(plan, flight, local.origin), {}};
  BOOST_OUTCOME_TRY(auto check, check_plan(out.plan));
  out.check = std::move(check);
  if (flight.n_unreachable > 0)
    out.check.issues.push_back(
        {Severity::warning, "unreachable", "/outline", left_out_text(flight.n_unreachable)});
  return out;
}

}  // namespace anchord::planning
