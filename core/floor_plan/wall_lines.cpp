#include "core/floor_plan/wall_lines.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "core/base/cross.hpp"

namespace anchord::floor_plan {
namespace {

constexpr double k_parallel_sine = 0.035;  ///< 2 degrees
constexpr double k_crossing_sine = 0.30;
/// Ink from face to face of a wall: what lies between two walls is paper.
constexpr double k_solid = 0.9;
/// Other walls that join leave gaps of their thickness in a face.
constexpr double k_joining_m = 1.0;
constexpr double k_least_piece_m = 0.10;
constexpr double k_corner_slack_m = 0.15;

Eigen::Vector2d perpendicular(const Eigen::Vector2d& v) { return {-v.y(), v.x()}; }

using Interval = std::pair<double, double>;

/// Parts of `whole` that none of `taken` covers.
std::vector<Interval> left_of(const Interval& whole, const std::vector<Interval>& taken) {
  std::vector<Interval> out{whole};
  for (const auto& [low, high] : taken) {
    std::vector<Interval> next;
    for (const auto& [a, b] : out) {
      if (high <= a || low >= b) {
        next.emplace_back(a, b);
        continue;
      }
      if (low > a) next.emplace_back(a, low);
      if (high < b) next.emplace_back(high, b);
    }
    out = std::move(next);
  }
  return out;
}

struct Facing {
  std::size_t a{}, b{};
  double apart_m{};
};

/// Faces with ink between them, the nearest first.
std::vector<Facing> facing_pairs(const std::vector<Face>& faces, const TraceOptions& options,
                                 double slack_m) {
  std::vector<Facing> out;
  for (std::size_t i = 0; i < faces.size(); ++i) {
    for (std::size_t j = i + 1; j < faces.size(); ++j) {
      const auto &a = faces[i], &b = faces[j];
      if (a.to_ink.dot(b.to_ink) > -0.99 || std::abs(cross(a.along, b.along)) > k_parallel_sine) continue;
      const double apart = a.to_ink.dot(b.at_m + 0.5 * (b.from_m + b.to_m) * b.along - a.at_m);
      if (apart < options.min_wall_m - slack_m || apart > options.max_wall_m) continue;
      out.push_back({i, j, apart});
    }
  }
  std::ranges::stable_sort(out, {}, &Facing::apart_m);
  return out;
}

/// Each stretch of a face belongs to the nearest face over there: farther ones are other walls' faces.
std::vector<WallLine> between(const std::vector<Face>& faces, const Mask& mask, const TraceOptions& options) {
  std::vector<std::vector<Interval>> taken(faces.size());
  std::vector<WallLine> out;
  for (const auto& pair : facing_pairs(faces, options, mask.cell_m)) {
    const auto &a = faces[pair.a], &b = faces[pair.b];
    // All along a's direction, from a's point.
    const double sign = a.along.dot(b.along) < 0 ? -1 : 1, shift = a.along.dot(b.at_m - a.at_m);
    const double b0 = shift + sign * b.from_m, b1 = shift + sign * b.to_m;
    const Interval both{std::max(a.from_m, std::min(b0, b1)), std::min(a.to_m, std::max(b0, b1))};
    // As long as it is thick at least: the two ends of a short wall face each other too.
    if (both.second - both.first < std::max(k_least_piece_m, pair.apart_m)) continue;
    auto covered = taken[pair.a];
    for (const auto& [low, high] : taken[pair.b]) {
      const double p = shift + sign * low, q = shift + sign * high;
      covered.emplace_back(std::min(p, q), std::max(p, q));
    }
    for (const auto& [low, high] : left_of(both, covered)) {
      if (high - low < k_least_piece_m) continue;
      WallLine wall;
      wall.along = a.along;
      wall.at_m = a.at_m + 0.5 * pair.apart_m * a.to_ink;
      wall.from_m = low;
      wall.to_m = high;
      wall.thickness_m = pair.apart_m;
      if (ink_along(mask, wall.begin_m(), wall.end_m()) < k_solid) continue;
      taken[pair.a].emplace_back(low, high);
      const double p = sign * (low - shift), q = sign * (high - shift);
      taken[pair.b].emplace_back(std::min(p, q), std::max(p, q));
      out.push_back(wall);
    }
  }
  return out;
}

/// Puts b into a where both are stretches of one wall.
bool join(WallLine& a, const WallLine& b, const Mask& mask) {
  if (std::abs(cross(a.along, b.along)) > k_parallel_sine) return false;
  const double thin = std::min(a.thickness_m, b.thickness_m), thick = std::max(a.thickness_m, b.thickness_m);
  if (thick > 1.6 * thin) return false;
  const double p = a.along.dot(b.begin_m() - a.at_m), q = a.along.dot(b.end_m() - a.at_m);
  const Interval other{std::min(p, q), std::max(p, q)};
  const Eigen::Vector2d normal = perpendicular(a.along);
  const double off = normal.dot(0.5 * (b.begin_m() + b.end_m()) - a.at_m);
  if (std::abs(off) > std::max(0.03, 0.35 * thin)) return false;
  const double gap = std::max(other.first - a.to_m, a.from_m - other.second);
  if (gap > k_joining_m) return false;
  if (gap > 2 * mask.cell_m) {
    const double low = other.first > a.to_m ? a.to_m : other.second, high = low + gap;
    if (ink_along(mask, a.at_m + low * a.along, a.at_m + high * a.along) < k_solid) return false;
  }
  const double la = a.length_m(), lb = b.length_m();
  // The longer one knows the direction; the place is shared by length.
  if (lb > la) {
    const Eigen::Vector2d from = a.begin_m(), to = a.end_m();
    WallLine longer = b;
    longer.at_m +=
        la / (la + lb) * perpendicular(b.along).dot(0.5 * (from + to) - b.at_m) * perpendicular(b.along);
    const double s = longer.along.dot(from - longer.at_m), t = longer.along.dot(to - longer.at_m);
    longer.from_m = std::min({longer.from_m, s, t});
    longer.to_m = std::max({longer.to_m, s, t});
    longer.thickness_m = (la * a.thickness_m + lb * b.thickness_m) / (la + lb);
    a = longer;
    return true;
  }
  a.at_m += lb / (la + lb) * off * normal;
  a.from_m = std::min(a.from_m, other.first);
  a.to_m = std::max(a.to_m, other.second);
  a.thickness_m = (la * a.thickness_m + lb * b.thickness_m) / (la + lb);
  return true;
}

void join_all(std::vector<WallLine>& walls, const Mask& mask) {
  for (bool changed = true; changed;) {
    changed = false;
    for (std::size_t i = 0; i < walls.size(); ++i) {
      for (std::size_t j = walls.size(); j-- > i + 1;) {
        if (!join(walls[i], walls[j], mask)) continue;
        walls.erase(walls.begin() + static_cast<std::ptrdiff_t>(j));
        changed = true;
      }
    }
  }
}

/// The inner face ends at a corner, the middle lines meet half a wall later: ends go to the line of the wall
/// they stand at.
void meet(std::vector<WallLine>& walls) {
  const auto before = walls;
  for (std::size_t i = 0; i < walls.size(); ++i) {
    const auto& self = before[i];
    for (const bool to : {false, true}) {
      const double end = to ? self.to_m : self.from_m;
      double best = end, nearest = std::numeric_limits<double>::infinity();
      for (std::size_t j = 0; j < before.size(); ++j) {
        const auto& other = before[j];
        const double sine = cross(self.along, other.along);
        if (j == i || std::abs(sine) < k_crossing_sine) continue;
        const double s = cross(other.at_m - self.at_m, other.along) / sine;
        const double t = cross(other.at_m - self.at_m, self.along) / sine;
        const double reach = (0.5 * other.thickness_m + k_corner_slack_m) / std::abs(sine);
        const double beside = 0.5 * self.thickness_m / std::abs(sine) + k_corner_slack_m;
        if (std::abs(s - end) > reach || t < other.from_m - beside || t > other.to_m + beside) continue;
        if (std::abs(s - end) < nearest) {
          nearest = std::abs(s - end);
          best = s;
        }
      }
      if (!std::isfinite(nearest)) continue;
      (to ? walls[i].to_m : walls[i].from_m) = best;
      (to ? walls[i].to_meets : walls[i].from_meets) = true;
    }
  }
}

}  // namespace

std::vector<WallLine> wall_lines(const std::vector<std::vector<Face>>& contours, const Mask& mask,
                                 const TraceOptions& options) {
  std::vector<Face> faces;
  for (const auto& contour : contours)
    for (const auto& face : contour)
      if (face.length_m() >= k_least_piece_m) faces.push_back(face);
  auto walls = between(faces, mask, options);
  join_all(walls, mask);
  meet(walls);
  std::erase_if(walls, [&](const WallLine& w) { return w.length_m() < options.min_length_m; });
  return walls;
}

}  // namespace anchord::floor_plan
