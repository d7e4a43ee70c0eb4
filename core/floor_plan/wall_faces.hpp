#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

/// Inside of trace.hpp. All metres of the plan's own axes: x to the right, y down.
namespace anchord::floor_plan {

/// Ink on a grid: 255, else 0.
struct Mask {
  int columns{}, rows{};
  double cell_m{};
  std::vector<std::uint8_t> ink;

  bool at(const Eigen::Vector2d& m) const {
    const auto x = static_cast<std::int64_t>(m.x() / cell_m), y = static_cast<std::int64_t>(m.y() / cell_m);
    if (m.x() < 0 || m.y() < 0 || x >= columns || y >= rows) return false;
    return ink[static_cast<std::size_t>(y * columns + x)] != 0;
  }
};

/// Share of a straight line that is ink.
double ink_along(const Mask& mask, const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m);

/// A straight piece of the ink's edge.
struct Face {
  Eigen::Vector2d at_m{0, 0};    ///< on its line
  Eigen::Vector2d along{1, 0};   ///< unit, in the order of the contour
  Eigen::Vector2d to_ink{0, 1};  ///< unit, at right angles
  double from_m{}, to_m{};       ///< its ends, along from at_m
  double length_m() const { return to_m - from_m; }
  Eigen::Vector2d begin_m() const { return at_m + from_m * along; }
  Eigen::Vector2d end_m() const { return at_m + to_m * along; }
};

struct FaceOptions {
  double tolerance_m{};    ///< of the edge round its straight pieces
  double trim_m{};         ///< ends that corners may have rounded, left out of the fit
  bool outer_only{false};  ///< holes are left out
  /// Pieces within this angle of a main direction are turned to it however long they are.
  double turn_rad{0};
  std::size_t most{20'000};
};

/// Straight pieces of every contour, in its order. `main_rad`: the building's direction (modulo 90 degrees),
/// which pieces are turned to where that moves their ends by less than 3 cm; absent: as they are.
std::vector<std::vector<Face>> faces_of(const Mask& mask, const FaceOptions& options,
                                        std::optional<double> main_rad);

/// The direction most of the length has, modulo 90 degrees.
double main_direction_rad(const std::vector<std::vector<Face>>& contours);

}  // namespace anchord::floor_plan
