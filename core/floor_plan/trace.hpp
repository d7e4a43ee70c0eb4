#pragma once

#include <Eigen/Core>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "core/floor_plan/georeference.hpp"
#include "core/floor_plan/image.hpp"

namespace anchord::floor_plan {

/// A wall by its middle line.
struct TracedWall {
  Eigen::Vector2d from_m{0, 0}, to_m{0, 0};
  double thickness_m{};
};

struct TraceOptions {
  double min_wall_m =
      0.07;  ///< thinner ink is text, furniture and dimensions; the thinnest partition is 7 cm
  double max_wall_m = 0.60;    ///< thicker ink is no wall: a filled area
  double min_length_m = 0.40;  ///< shorter pieces are not proposed
  double opening_m = 2.60;     ///< doors and windows up to here are closed in the outline
};

/// What a plan shows, as a proposal for a person. ENU metres.
struct Trace {
  std::vector<Eigen::Vector2d> outline_m;  ///< of the building, corners in order, not closed
  std::vector<TracedWall> walls;           ///< openings are gaps
  double cell_m{};                 ///< of the grid it was traced on: nothing is known better than half of it
  std::vector<std::string> notes;  ///< for people: what to look at
};

/// Called between steps with the share done and the step; false ends the work.
using TraceProgress = std::function<bool(double fraction, std::string_view step)>;

/// Outline and walls of a plan whose walls are filled with ink: threshold (Otsu), opening (text, furniture
/// and dimension lines are thinner than walls), straight pieces of the ink's edge, turned to the building's
/// two main directions where they differ from them by less than 3 cm at their ends, walls between facing
/// edges.
///
/// rgb        3 channels; dark ink on light paper
/// transform  of its pixels; its own shear is taken as none within a wall
/// errors     invalid_argument (no scale a wall can be seen at), weak_geometry (no ink, no walls, no closed
///            outline), canceled
/// accuracy   drawn plans of 1 to 2.5 cm a pixel, turned, with text and furniture: outline within 5 cm, 95 %
///            of the wall length within 10 cm (trace_test.cpp)
/// memory     6 bytes a cell of the grid, at most 64 million cells, beside the image
/// threads    pure
Result<Trace> trace_plan(const Image& rgb, const PlanTransform& transform, const TraceOptions& options = {},
                         const TraceProgress& progress = {});

}  // namespace anchord::floor_plan
