#include "core/floor_plan/trace_outline.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/cross.hpp"

namespace anchord::floor_plan {
namespace {

constexpr double k_spur_m = 0.30;         ///< half the width below which a part of the building is a spur
constexpr double k_tolerance_m = 0.06;    ///< of the outline round its straight pieces
constexpr double k_least_face_m = 0.25;   ///< shorter pieces are steps between their neighbours
constexpr double k_same_line_m = 0.12;    ///< neighbours that differ by less are one
constexpr double k_parallel_sine = 0.10;  ///< 6 degrees
constexpr double k_least_area_m2 = 4;
constexpr int k_shift = 4;  ///< sixteenths of a cell where shapes are drawn

cv::Mat as_mat(Mask& mask) { return cv::Mat(mask.rows, mask.columns, CV_8U, mask.ink.data()); }

/// A wall's rectangle of ink, between two points of its middle line.
void draw(cv::Mat& to, double cell_m, const Eigen::Vector2d& a, const Eigen::Vector2d& b,
          double thickness_m) {
  const Eigen::Vector2d along = (b - a).normalized(),
                        side = 0.5 * thickness_m * Eigen::Vector2d(-along.y(), along.x());
  std::vector<cv::Point> corners;
  for (const Eigen::Vector2d& p : {Eigen::Vector2d(a + side), Eigen::Vector2d(b + side),
                                   Eigen::Vector2d(b - side), Eigen::Vector2d(a - side)})
    // A pixel is drawn where its middle is; the outermost middles lie half a cell inside of the edge.
    corners.emplace_back(static_cast<int>(std::lround((p.x() / cell_m - 0.5) * (1 << k_shift))),
                         static_cast<int>(std::lround((p.y() / cell_m - 0.5) * (1 << k_shift))));
  cv::fillConvexPoly(to, corners, cv::Scalar(255), cv::LINE_8, k_shift);
}

struct End {
  Eigen::Vector2d at, outward;
  double thickness_m{};
  std::size_t wall{};
};

std::vector<End> free_ends(const std::vector<WallLine>& lines) {
  std::vector<End> out;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto& w = lines[i];
    if (!w.from_meets) out.push_back({w.begin_m(), -w.along, w.thickness_m, i});
    if (!w.to_meets) out.push_back({w.end_m(), w.along, w.thickness_m, i});
  }
  return out;
}

/// Doors and windows: from a wall's free end to the next wall on its own line, or else to the wall it would
/// run into.
void close_openings(cv::Mat& mask, double cell_m, const std::vector<WallLine>& lines,
                    const TraceOptions& options) {
  const auto ends = free_ends(lines);
  for (std::size_t i = 0; i < ends.size(); ++i) {
    const auto& end = ends[i];
    double nearest = options.opening_m;
    std::optional<Eigen::Vector2d> target;
    for (std::size_t j = 0; j < ends.size(); ++j) {
      const auto& other = ends[j];
      if (other.wall == end.wall || end.outward.dot(other.outward) > -0.99) continue;
      const Eigen::Vector2d way = other.at - end.at;
      const double ahead = end.outward.dot(way), aside = std::abs(cross(end.outward, way));
      if (ahead <= 0 || ahead > nearest ||
          aside > std::max(0.06, 0.5 * std::min(end.thickness_m, other.thickness_m)))
        continue;
      nearest = ahead;
      target = other.at;
    }
    for (std::size_t j = 0; !target && j < lines.size(); ++j) {
      const auto& wall = lines[j];
      const double sine = cross(end.outward, wall.along);
      if (j == end.wall || std::abs(sine) < 0.3) continue;
      const double ahead = cross(wall.at_m - end.at, wall.along) / sine;
      const double t = cross(wall.at_m - end.at, end.outward) / sine;
      if (ahead <= 0 || ahead > nearest || t < wall.from_m - 0.5 * end.thickness_m ||
          t > wall.to_m + 0.5 * end.thickness_m)
        continue;
      nearest = ahead;
      target = end.at + ahead * end.outward;
    }
    if (target) draw(mask, cell_m, end.at - 2 * cell_m * end.outward, *target, end.thickness_m);
  }
}

/// All that cannot be reached from the edge of the sheet.
cv::Mat enclosed(const cv::Mat& ink) {
  cv::Mat sheet;
  cv::copyMakeBorder(ink, sheet, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  cv::floodFill(sheet, {0, 0}, cv::Scalar(128));
  return cv::Mat(sheet != 128)(cv::Rect(1, 1, ink.cols, ink.rows)).clone();
}

/// What of a mask lies farther than this from its edge; beyond the sheet is `beyond`.
cv::Mat farther_than(const cv::Mat& mask, double cells, double beyond) {
  cv::Mat sheet, distance;
  cv::copyMakeBorder(mask, sheet, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(beyond));
  cv::distanceTransform(sheet, distance, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  return cv::Mat(distance > cells)(cv::Rect(1, 1, mask.cols, mask.rows)).clone();
}
// By the distance, whose cost does not grow with the width as that of a kernel does.
cv::Mat eroded(const cv::Mat& mask, double cells) { return farther_than(mask, cells, 0); }
cv::Mat dilated(const cv::Mat& mask, double cells) {
  return cv::Mat(255 - farther_than(cv::Mat(255 - mask), cells, 255));
}

/// Without the walls that stand out of it. What an opening takes away beside them are the tips of corners,
/// which are put back.
cv::Mat without_spurs(const cv::Mat& building, double cell_m) {
  const cv::Mat opened = dilated(eroded(building, k_spur_m / cell_m), k_spur_m / cell_m);
  const cv::Mat rest = building & (255 - opened);
  cv::Mat labels, stats, middles;
  const int n = cv::connectedComponentsWithStats(rest, labels, stats, middles, 8);
  std::vector<std::uint8_t> keep(static_cast<std::size_t>(n), 0);
  for (int i = 1; i < n; ++i) {
    const double w = stats.at<int>(i, cv::CC_STAT_WIDTH), h = stats.at<int>(i, cv::CC_STAT_HEIGHT);
    keep[static_cast<std::size_t>(i)] = std::hypot(w, h) * cell_m < 2 * k_spur_m ? 1 : 0;
  }
  cv::Mat out = opened & building;
  for (int y = 0; y < out.rows; ++y)
    for (int x = 0; x < out.cols; ++x)
      if (keep[static_cast<std::size_t>(labels.at<int>(y, x))] != 0) out.at<std::uint8_t>(y, x) = 255;
  return out;
}

/// The largest part alone; its area in cells.
double keep_largest(cv::Mat& mask, double& second) {
  cv::Mat labels, stats, middles;
  const int n = cv::connectedComponentsWithStats(mask, labels, stats, middles, 8);
  int best = 0;
  double area = 0;
  second = 0;
  for (int i = 1; i < n; ++i) {
    const double one = stats.at<int>(i, cv::CC_STAT_AREA);
    if (one > area) {
      second = area;
      area = one;
      best = i;
    } else {
      second = std::max(second, one);
    }
  }
  mask = best == 0 ? cv::Mat(cv::Mat::zeros(mask.size(), CV_8U)) : cv::Mat(labels == best);
  return area;
}

Eigen::Vector2d on_line(const Face& face, const Eigen::Vector2d& p) {
  return face.at_m + face.along.dot(p - face.at_m) * face.along;
}

/// Corners where neighbouring pieces meet; a step between two that run the same way.
std::vector<Eigen::Vector2d> corners_of(std::vector<Face> faces) {
  std::erase_if(faces, [](const Face& f) { return f.length_m() < k_least_face_m; });
  std::vector<Face> merged;
  for (const auto& face : faces) {
    if (!merged.empty()) {
      auto& last = merged.back();
      const bool parallel =
          std::abs(cross(last.along, face.along)) < k_parallel_sine && last.along.dot(face.along) > 0;
      if (parallel && (on_line(last, face.begin_m()) - face.begin_m()).norm() < k_same_line_m &&
          (on_line(last, face.end_m()) - face.end_m()).norm() < k_same_line_m) {
        const Eigen::Vector2d end = face.end_m();
        if (face.length_m() > last.length_m()) {
          const Eigen::Vector2d begin = last.begin_m();
          last = face;
          last.from_m = last.along.dot(begin - last.at_m);
        } else {
          last.to_m = last.along.dot(end - last.at_m);
        }
        continue;
      }
    }
    merged.push_back(face);
  }
  if (merged.size() > 3) {
    const auto &first = merged.front(), &last = merged.back();
    if (std::abs(cross(last.along, first.along)) < k_parallel_sine && last.along.dot(first.along) > 0 &&
        (on_line(first, last.end_m()) - last.end_m()).norm() < k_same_line_m) {
      if (last.length_m() > first.length_m()) merged.front() = last;
      merged.pop_back();
    }
  }
  std::vector<Eigen::Vector2d> out;
  for (std::size_t i = 0; i < merged.size(); ++i) {
    const auto &a = merged[i], &b = merged[(i + 1) % merged.size()];
    const double sine = cross(a.along, b.along);
    if (std::abs(sine) < 0.2) {
      const Eigen::Vector2d between = 0.5 * (a.end_m() + b.begin_m());
      out.push_back(on_line(a, between));
      out.push_back(on_line(b, between));
    } else {
      out.push_back(a.at_m + cross(b.at_m - a.at_m, b.along) / sine * a.along);
    }
  }
  return out;
}

double area_m2(const std::vector<Eigen::Vector2d>& corners) {
  double sum = 0;
  for (std::size_t i = 0; i < corners.size(); ++i)
    sum += cross(corners[i], corners[(i + 1) % corners.size()]);
  return std::abs(sum) / 2;
}

}  // namespace

Result<std::vector<Eigen::Vector2d>> building_outline(const Mask& walls, const std::vector<WallLine>& lines,
                                                      double main_rad, const TraceOptions& options,
                                                      std::vector<std::string>& notes) {
  Mask work = walls;
  cv::Mat ink = as_mat(work);
  // With every gap of an opening's width closed, whatever is beside it: what there is at most.
  const double half_opening = 0.5 * options.opening_m / work.cell_m;
  cv::Mat rough = eroded(enclosed(dilated(ink, half_opening)), half_opening);
  double second = 0;
  const double rough_cells = keep_largest(rough, second);
  close_openings(ink, work.cell_m, lines, options);
  cv::Mat building = without_spurs(enclosed(ink), work.cell_m);
  double cells = keep_largest(building, second);
  if (cells < 0.6 * rough_cells) {
    building = rough;
    cells = rough_cells;
    notes.emplace_back(
        "the outer walls have gaps that are not doors: the outline is rounded there; check its corners");
  } else if (second > 0.2 * cells) {
    notes.emplace_back("the plan shows more than one building: the outline is of the largest");
  }
  const double area = cells * work.cell_m * work.cell_m;
  if (area < k_least_area_m2)
    return make_error(Errc::weak_geometry, "the walls of the plan enclose no area: draw the outline by hand");
  building.copyTo(ink);
  const FaceOptions how{.tolerance_m = k_tolerance_m, .trim_m = 0.2, .outer_only = true, .turn_rad = 0.03};
  const auto contours = faces_of(work, how, main_rad);
  if (contours.empty())
    return make_error(Errc::weak_geometry, "the plan shows no building: draw the outline by hand");
  const auto& longest = *std::ranges::max_element(contours, {}, &std::vector<Face>::size);
  auto corners = corners_of(longest);
  if (corners.size() < 3 || std::abs(area_m2(corners) / area - 1) > 0.03) {
    corners.clear();
    for (const auto& face : longest) corners.push_back(face.begin_m());
    notes.emplace_back("the outline has few straight edges: it is taken as drawn, not straightened");
  }
  return corners;
}

}  // namespace anchord::floor_plan
