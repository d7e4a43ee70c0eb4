#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "core/base/result.hpp"

namespace anchord::floor_plan {

/// A straight line of a drawing, in its own units.
struct DrawnLine {
  Eigen::Vector2d from{0, 0}, to{0, 0};
  bool on_wall_layer{false};  ///< by the name of its layer, in eight languages
};

struct Drawing {
  std::vector<DrawnLine> lines;
  double unit_m{};  ///< of one unit; 0: the file does not say
};

/// More lines than any floor of a building has; blocks inside blocks unfold to any number.
inline constexpr std::size_t k_max_drawn_lines = 1'000'000;

/// Whether a file begins as a DXF does: its first group is SECTION, comments before it left out.
bool is_dxf(std::span<const std::byte> bytes);

/// What a DXF (ASCII, R12 and later) shows in its model space, as straight lines: LINE, LWPOLYLINE, POLYLINE,
/// ARC, CIRCLE, ELLIPSE, SPLINE (its fit or control points), SOLID, 3DFACE, and blocks wherever they are
/// inserted. Text, dimensions and hatches are left out, and so is what stands on a layer that is off or
/// frozen. Curves are cut every five degrees. Heights are ignored.
///
/// errors   unsupported (a binary DXF), bad_frame (cut short or broken, with its line), invalid_argument
/// (more
///          than k_max_drawn_lines), weak_geometry (no line in it)
/// memory   the lines, and an index of its blocks
/// threads  pure
/// source   Autodesk DXF reference, group codes of the ENTITIES and BLOCKS sections
Result<Drawing> read_dxf(std::span<const std::byte> bytes);

}  // namespace anchord::floor_plan
