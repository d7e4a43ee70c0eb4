#pragma once

#include <Eigen/Core>
#include <optional>
#include <string_view>
#include <vector>

#include "core/base/enum_table.hpp"

namespace anchord::planning {

/// Corners in order, either way round; the last one joins the first. Fewer than three corners: no area.
using Polygon = std::vector<Eigen::Vector2d>;

/// A straight obstacle seen from above, from floor to sky.
struct Wall {
  Eigen::Vector2d a_m{0, 0}, b_m{0, 0};
  double keep_out_m{0};  ///< the aircraft stays at least this far away; 0: it only may not cross
  double p_nlos{0};      ///< probability that a range through it is not line of sight
};

/// Where the aircraft may be. All metres in the frame of the candidates; heights are the third coordinate.
struct Bounds {
  Polygon fence;                ///< stay inside; empty: no fence
  std::vector<Polygon> no_fly;  ///< stay outside, by `keep_out_m`
  std::vector<Wall> walls;
  double keep_out_m{0};
  std::optional<double> min_height_m, max_height_m;
};

/// Why a candidate may not be flown to.
enum class Refusal : unsigned char {
  visited,
  unreachable,  ///< tried before and not reached, or no connection there
  outside_fence,
  no_fly,
  near_wall,
  too_low,
  too_high,
  path_blocked,  ///< the point is fine, the straight way to it is not
  over_range,    ///< too far from every anchor
  on_anchor,     ///< no direction from there
};
inline constexpr auto k_refusal_words = enum_table<Refusal>({{"visited", Refusal::visited},
                                                             {"unreachable", Refusal::unreachable},
                                                             {"outside_fence", Refusal::outside_fence},
                                                             {"no_fly", Refusal::no_fly},
                                                             {"near_wall", Refusal::near_wall},
                                                             {"too_low", Refusal::too_low},
                                                             {"too_high", Refusal::too_high},
                                                             {"path_blocked", Refusal::path_blocked},
                                                             {"over_range", Refusal::over_range},
                                                             {"on_anchor", Refusal::on_anchor}});
constexpr std::string_view to_string(Refusal refusal) { return k_refusal_words.word(refusal); }

/// Inside or on the edge.
bool contains(const Polygon& polygon, const Eigen::Vector2d& point_m);
/// Touching counts as crossing; collinear overlap too.
bool segments_cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                    const Eigen::Vector2d& d);
double distance_to_segment_m(const Eigen::Vector2d& point, const Eigen::Vector2d& a,
                             const Eigen::Vector2d& b);
/// 0 where they cross.
double distance_between_segments_m(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                                   const Eigen::Vector2d& c, const Eigen::Vector2d& d);
/// To the nearest edge, from either side.
double distance_to_edge_m(const Polygon& polygon, const Eigen::Vector2d& point_m);

/// Two of its sides cross; touching is not crossing. Of more than 2000 corners, a survey and not a slip of
/// the mouse, none is looked at.
bool crosses_itself(const Polygon& polygon);

/// The whole of `inner` lies in `outer`, its edge at most `slack_m` outside (looked at every half metre).
bool covers(const Polygon& outer, const Polygon& inner, double slack_m);

/// First rule the point breaks; nothing when it may be flown to. Not finite: outside_fence.
std::optional<Refusal> refuse_point(const Bounds& bounds, const Eigen::Vector3d& point_m);

/// First rule the straight way breaks. Where the way starts is not judged (the aircraft is there already),
/// only what it crosses or comes too near to; leaving a keep-out zone outwards is allowed, going deeper is
/// not; from outside the fence it may come in, once.
std::optional<Refusal> refuse_path(const Bounds& bounds, const Eigen::Vector3d& from_m,
                                   const Eigen::Vector3d& to_m);

/// Probability that the straight line is not line of sight, of independent walls: 1 - prod (1 - p).
double p_nlos_through(const Bounds& bounds, const Eigen::Vector3d& from_m, const Eigen::Vector3d& to_m);

}  // namespace anchord::planning
