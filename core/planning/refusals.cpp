#include "core/planning/refusals.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "core/planning/gdop.hpp"

namespace anchord::planning {
namespace {

/// The three axes of a grid, and where it keeps what.
class Axes {
 public:
  Axes(const GridOptions& options, const Eigen::Vector3d& centre)
      : centre_(centre),
        step_(options.step_m, options.step_m, options.step_up_m),
        reach_{options.reach, options.reach, options.reach_up},
        across_(2 * static_cast<std::size_t>(options.reach) + 1),
        upward_(2 * static_cast<std::size_t>(options.reach_up) + 1) {}

  std::size_t columns() const { return across_ * across_; }
  std::size_t upward() const { return upward_; }

  /// visit(i) for every candidate in the box of `half` about a place, and perhaps for some just outside.
  template <class Visit>
  void for_each_near(const Eigen::Vector3d& place, const Eigen::Vector3d& half, Visit&& visit) const {
    const Span x = span(0, place, half), y = span(1, place, half), z = span(2, place, half);
    for (int iy = y.from; iy <= y.to; ++iy) {
      for (int ix = x.from; ix <= x.to; ++ix) {
        for (int iz = z.from; iz <= z.to; ++iz) visit(index(ix, iy, iz));
      }
    }
  }

 private:
  struct Span {
    int from, to;  ///< in cells from the centre
  };
  Span span(int axis, const Eigen::Vector3d& place, const Eigen::Vector3d& half) const {
    constexpr double k_more = 1e-3;  // of a cell: rounding loses no candidate, whoever visits asks exactly
    const double reach = reach_[static_cast<std::size_t>(axis)];
    const double at = (place[axis] - centre_[axis]) / step_[axis], more = half[axis] / step_[axis] + k_more;
    return {static_cast<int>(std::ceil(std::clamp(at - more, -reach, reach + 1))),
            static_cast<int>(std::floor(std::clamp(at + more, -reach - 1, reach)))};
  }
  std::size_t index(int ix, int iy, int iz) const {
    const auto row = static_cast<std::size_t>(iy + reach_[1]),
               column = static_cast<std::size_t>(ix + reach_[0]);
    return (row * across_ + column) * upward_ + static_cast<std::size_t>(iz + reach_[2]);
  }

  Eigen::Vector3d centre_, step_;
  std::array<int, 3> reach_;
  std::size_t across_, upward_;
};

/// Candidates within a share of a step of any of these points.
void refuse_near(const std::vector<Eigen::Vector3d>& points, const NextPointOptions& options,
                 const Axes& axes, const Grid& grid, Refusal why, Refusals& out) {
  const double step_m = options.grid.step_m, step_up_m = options.grid.step_up_m,
               share = options.visited_share;
  const Eigen::Vector3d half = share * Eigen::Vector3d(step_m, step_m, step_up_m);
  for (const auto& point : points) {
    if (!point.allFinite()) continue;
    axes.for_each_near(point, half, [&](std::size_t i) {
      if (std::abs(grid.x_m[i] - point.x()) / step_m < share &&
          std::abs(grid.y_m[i] - point.y()) / step_m < share &&
          std::abs(grid.z_m[i] - point.z()) / step_up_m < share)
        out.refuse(i, why);
    });
  }
}

/// Fences, areas and walls stand from floor to sky: one answer for all candidates above one another.
void refuse_by_bounds(const Bounds& bounds, const Eigen::Vector3d& current, const Axes& axes,
                      const Grid& grid, Refusals& out) {
  const bool flat = bounds.fence.empty() && bounds.no_fly.empty() && bounds.walls.empty();
  if (flat && !bounds.min_height_m && !bounds.max_height_m) return;
  Bounds at_any_height = bounds;
  at_any_height.min_height_m = at_any_height.max_height_m = std::nullopt;
  for (std::size_t column = 0; column < axes.columns(); ++column) {
    const std::size_t begin = column * axes.upward(), end = begin + axes.upward();
    const auto here = flat ? std::nullopt : refuse_point(at_any_height, grid.at(begin));
    const auto way = flat || here ? std::nullopt : refuse_path(at_any_height, current, grid.at(begin));
    for (std::size_t i = begin; i < end; ++i) {
      if (here) out.refuse(i, *here);
      if (bounds.min_height_m && grid.z_m[i] < *bounds.min_height_m) out.refuse(i, Refusal::too_low);
      if (bounds.max_height_m && grid.z_m[i] > *bounds.max_height_m) out.refuse(i, Refusal::too_high);
      if (way) out.refuse(i, *way);
    }
  }
}

void refuse_on_anchors(const NextPointInput& input, const NextPointOptions& options, const Axes& axes,
                       const Grid& grid, Refusals& out) {
  const bool plane = options.dims == 2;
  const Eigen::Vector3d half(k_min_distance_m, k_min_distance_m,
                             plane ? std::numeric_limits<double>::infinity() : k_min_distance_m);
  for (const auto& anchor : input.anchors) {
    for (const auto& place : anchor.places) {
      axes.for_each_near(place.position_m, half, [&](std::size_t i) {
        const Eigen::Vector3d d = grid.at(i) - place.position_m;
        if ((plane ? d.head<2>().norm() : d.norm()) <= k_min_distance_m) out.refuse(i, Refusal::on_anchor);
      });
    }
  }
}

void refuse_over_range(const NextPointInput& input, const NextPointOptions& options, const Grid& grid,
                       Refusals& out) {
  if (!options.max_range_m) return;
  for (std::size_t i = 0; i < grid.size(); ++i) {
    const Eigen::Vector3d point = grid.at(i);
    const auto too_far = [&](const Place& place) { return out_of_range(options, point, place.position_m); };
    if (std::ranges::all_of(input.anchors, [&](const PlannedAnchor& anchor) {
          return std::ranges::all_of(anchor.places, too_far);
        }))
      out.refuse(i, Refusal::over_range);
  }
}

}  // namespace

bool out_of_range(const NextPointOptions& options, const Eigen::Vector3d& point_m,
                  const Eigen::Vector3d& place_m) {
  return options.max_range_m && (point_m - place_m).norm() > *options.max_range_m;
}

Refusals refusals_of(const NextPointInput& input, const NextPointOptions& options,
                     const Eigen::Vector3d& current, const Grid& grid) {
  const Axes axes(options.grid, current);
  Refusals out(grid.size());
  refuse_near(input.unreachable, options, axes, grid, Refusal::unreachable, out);
  refuse_near({current}, options, axes, grid, Refusal::visited, out);
  refuse_near(input.visited, options, axes, grid, Refusal::visited, out);
  refuse_by_bounds(input.bounds, current, axes, grid, out);
  refuse_on_anchors(input, options, axes, grid, out);
  refuse_over_range(input, options, grid, out);
  return out;
}

}  // namespace anchord::planning
