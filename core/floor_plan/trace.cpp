#include "core/floor_plan/trace.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/floor_plan/trace_outline.hpp"
#include "core/floor_plan/wall_faces.hpp"
#include "core/floor_plan/wall_lines.hpp"

namespace anchord::floor_plan {
namespace {

constexpr double k_cell_m = 0.0125;  ///< the thinnest wall is five cells across
constexpr int k_max_side_cells = 8000;
constexpr double k_coarsest_m = 0.06;  ///< a pixel: the thinnest wall is then no longer seen
constexpr double k_detached_m = 1.0;   ///< ink that is smaller and joined to nothing is a symbol

std::string text(const char* format, double a, double b = 0) {
  char buffer[240];
  std::snprintf(buffer, sizeof buffer, format, a, b);
  return buffer;
}

/// The plan's own axes in metres, and their cells.
struct Grid {
  Eigen::Vector2d m_per_px{1, 1};
  double cell_m{k_cell_m};
  int columns{}, rows{};
};

Result<Grid> grid_of(const Image& image, const PlanTransform& transform) {
  Grid g;
  g.m_per_px = {transform.linear.col(0).norm(), transform.linear.col(1).norm()};
  const double px = g.m_per_px.maxCoeff();
  if (!(px > 1e-4) || px > k_coarsest_m)
    return make_error(Errc::invalid_argument,
                      text("a pixel of the plan is %.4f m: walls are traced between 0.0001 and %.2f m per "
                           "pixel; check the georeference, or scan the plan at a higher resolution",
                           px, k_coarsest_m));
  const Eigen::Vector2d extent(image.width_px * g.m_per_px.x(), image.height_px * g.m_per_px.y());
  // Coarse plans are refined by a whole number, so that their pixels stay what they are.
  if (px > k_cell_m) g.cell_m = px / std::ceil(px / (1.5 * k_cell_m));
  g.cell_m = std::max(g.cell_m, extent.maxCoeff() / k_max_side_cells);
  g.columns = std::max(8, static_cast<int>(std::lround(extent.x() / g.cell_m)));
  g.rows = std::max(8, static_cast<int>(std::lround(extent.y() / g.cell_m)));
  return g;
}

cv::Mat grey_on(const Image& rgb, const Grid& g) {
  const cv::Mat colours(rgb.height_px, rgb.width_px, CV_8UC3, const_cast<std::uint8_t*>(rgb.pixels.data()));
  cv::Mat grey, out;
  cv::cvtColor(colours, grey, cv::COLOR_RGB2GRAY);
  const bool smaller = g.columns < rgb.width_px;
  cv::resize(grey, out, {g.columns, g.rows}, 0, 0, smaller ? cv::INTER_AREA : cv::INTER_LINEAR);
  return out;
}

/// Ink as thick as a wall. errors: weak_geometry (a blank sheet, or a dark one)
Result<cv::Mat> thick_ink(const cv::Mat& grey, const Grid& g, const TraceOptions& options) {
  cv::Mat ink;
  cv::threshold(grey, ink, 0, 255, cv::THRESH_BINARY_INV | cv::THRESH_OTSU);
  const double share = cv::countNonZero(ink) / static_cast<double>(grey.total());
  double darkest = 0, lightest = 0;
  cv::minMaxLoc(grey, &darkest, &lightest);
  if (lightest - darkest < 40 || share < 1e-4 || share > 0.6)
    return make_error(Errc::weak_geometry,
                      text("the plan has no dark lines on light paper (%.1f %% ink, contrast %.0f of 255): "
                           "only a drawing can be traced, not a photograph",
                           100 * share, lightest - darkest));
  // Odd: with an even kernel OpenCV's opening moves everything by one cell.
  const int fits = static_cast<int>(std::floor(options.min_wall_m / g.cell_m));
  const int width = std::max(3, fits - 1 + fits % 2);
  cv::Mat opened;
  cv::morphologyEx(ink, opened, cv::MORPH_OPEN, cv::getStructuringElement(cv::MORPH_ELLIPSE, {width, width}),
                   {-1, -1}, 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  return opened;
}

/// What is ink and no wall: symbols and letters that touch nothing, filled areas, the frame of the sheet.
void remove_what_is_no_wall(cv::Mat& ink, const Grid& g, const TraceOptions& options) {
  cv::Mat depth, labels, stats, middles;
  cv::distanceTransform(ink, depth, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  const int n = cv::connectedComponentsWithStats(ink, labels, stats, middles, 8);
  std::vector<double> deep(static_cast<std::size_t>(n), 0);
  const auto half = static_cast<float>(0.5 * options.max_wall_m / g.cell_m);
  for (int y = 0; y < ink.rows; ++y)
    for (int x = 0; x < ink.cols; ++x)
      if (depth.at<float>(y, x) > half) ++deep[static_cast<std::size_t>(labels.at<int>(y, x))];
  std::vector<std::uint8_t> keep(static_cast<std::size_t>(n), 0);
  for (int i = 1; i < n; ++i) {
    const double w = stats.at<int>(i, cv::CC_STAT_WIDTH), h = stats.at<int>(i, cv::CC_STAT_HEIGHT),
                 area = stats.at<int>(i, cv::CC_STAT_AREA);
    const bool symbol = std::hypot(w, h) * g.cell_m < k_detached_m;
    const bool filled = deep[static_cast<std::size_t>(i)] > 0.1 * area;
    const bool frame = w > 0.9 * ink.cols && h > 0.9 * ink.rows && area < 0.02 * w * h;
    keep[static_cast<std::size_t>(i)] = symbol || filled || frame ? 0 : 255;
  }
  for (int y = 0; y < ink.rows; ++y)
    for (int x = 0; x < ink.cols; ++x)
      ink.at<std::uint8_t>(y, x) = keep[static_cast<std::size_t>(labels.at<int>(y, x))];
}

bool inside(const std::vector<Eigen::Vector2d>& corners, const Eigen::Vector2d& p) {
  bool in = false;
  for (std::size_t i = 0, j = corners.size() - 1; i < corners.size(); j = i++) {
    const auto &a = corners[i], &b = corners[j];
    if ((a.y() > p.y()) != (b.y() > p.y()) &&
        p.x() < (b.x() - a.x()) * (p.y() - a.y()) / (b.y() - a.y()) + a.x())
      in = !in;
  }
  return in;
}

Result<Trace> trace_checked(const Image& rgb, const PlanTransform& transform, const TraceOptions& options,
                            const TraceProgress& progress) {
  const auto goes_on = [&](double fraction, std::string_view step) {
    return !progress || progress(fraction, step);
  };
  const auto stopped = [] { return make_error(Errc::canceled, "canceled"); };
  BOOST_OUTCOME_TRY(const auto grid, grid_of(rgb, transform));
  if (!goes_on(0.05, "ink")) return stopped();
  BOOST_OUTCOME_TRY(auto ink, thick_ink(grey_on(rgb, grid), grid, options));
  remove_what_is_no_wall(ink, grid, options);
  if (!goes_on(0.4, "walls")) return stopped();
  Mask mask{grid.columns, grid.rows, grid.cell_m, {}};
  mask.ink.assign(ink.datastart, ink.dataend);
  FaceOptions how;
  how.tolerance_m = std::max(0.03, 1.5 * grid.cell_m);
  how.trim_m = 0.06;
  const double main_rad = main_direction_rad(faces_of(mask, how, {}));
  const auto faces = faces_of(mask, how, main_rad);
  std::size_t total = 0;
  for (const auto& contour : faces) total += contour.size();
  if (total > how.most)
    return make_error(Errc::weak_geometry,
                      "the plan has more than 20000 edges as thick as a wall: only a drawing can be traced, "
                      "not a photograph; remove hatching and textures");
  const auto lines = wall_lines(faces, mask, options);
  if (lines.empty())
    return make_error(Errc::weak_geometry,
                      text("no walls found: walls must be drawn filled, %.2f to %.2f m thick; walls drawn as "
                           "two thin lines are not traced, fill them first",
                           options.min_wall_m, options.max_wall_m));
  if (!goes_on(0.7, "outline")) return stopped();
  Trace out;
  out.cell_m = grid.cell_m;
  BOOST_OUTCOME_TRY(const auto outline, building_outline(mask, lines, main_rad, options, out.notes));
  const auto enu = [&](const Eigen::Vector2d& m) {
    return transform.enu_from(Eigen::Vector2d(m.x() / grid.m_per_px.x(), m.y() / grid.m_per_px.y()));
  };
  for (const auto& corner : outline) out.outline_m.push_back(enu(corner));
  for (const auto& line : lines) {
    // Beside the building: a legend, a north arrow, a fence.
    if (!inside(outline, 0.5 * (line.begin_m() + line.end_m()))) continue;
    out.walls.push_back({enu(line.begin_m()), enu(line.end_m()), line.thickness_m});
  }
  if (grid.cell_m > 0.025)
    out.notes.push_back(text("traced on a grid of %.3f m cells: walls thinner than %.2f m may be missing",
                             grid.cell_m, 3 * grid.cell_m));
  return out;
}

}  // namespace

Result<Trace> trace_plan(const Image& rgb, const PlanTransform& transform, const TraceOptions& options,
                         const TraceProgress& progress) {
  if (rgb.channels != 3 || rgb.pixels.size() != 3 * static_cast<std::size_t>(rgb.width_px) *
                                                    static_cast<std::size_t>(rgb.height_px))
    return make_error(Errc::invalid_argument, "the image is not an RGB picture");
  // One thread: whoever flies beside needs the other cores.
  cv::setNumThreads(1);
  try {
    return trace_checked(rgb, transform, options, progress);
  } catch (const cv::Exception& fault) {
    return make_error(Errc::internal, "OpenCV: " + std::string(fault.err.c_str()));
  }
}

}  // namespace anchord::floor_plan
