#include "core/floor_plan/draw.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace anchord::floor_plan {
namespace {

using Eigen::Vector2d;

constexpr double k_pixel_m = 0.02, k_longest_px = 9000;
constexpr int k_margin_px = 20;
constexpr double k_min_wall_m = 0.07, k_max_wall_m = 0.60;  ///< of trace_plan
constexpr double k_min_face_m = 0.25, k_min_overlap_m = 0.20;
constexpr double k_bin_rad = 0.1 * std::numbers::pi / 180;
constexpr std::size_t k_max_pairs = 50'000'000;  ///< looked at; a drawing of hatches has more

struct Box {
  Vector2d low{0, 0}, high{0, 0};
  double longest() const { return (high - low).maxCoeff(); }
};

/// Where the drawing is: the middle 98 % of its line length, and as much again on every side.
Box inner_box(const std::vector<DrawnLine>& lines) {
  Box out;
  double total = 0;
  for (const auto& line : lines) total += (line.to - line.from).norm();
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<std::pair<double, double>> at;  // middle, length
    at.reserve(lines.size());
    for (const auto& line : lines)
      at.emplace_back(0.5 * (line.from[axis] + line.to[axis]), (line.to - line.from).norm());
    std::ranges::sort(at);
    double sum = 0;
    out.low[axis] = at.front().first;
    out.high[axis] = at.back().first;
    for (const auto& [middle, length] : at) {
      if (sum < 0.01 * total) out.low[axis] = middle;
      if (sum < 0.99 * total) out.high[axis] = middle;
      sum += length;
    }
  }
  const double reach = out.longest();
  return {out.low.array() - reach, out.high.array() + reach};
}

bool inside(const Box& box, const Vector2d& at) {
  return (at.array() >= box.low.array()).all() && (at.array() <= box.high.array()).all();
}

std::vector<DrawnLine> without_strays(const std::vector<DrawnLine>& lines) {
  std::vector<DrawnLine> out;
  const auto box = inner_box(lines);
  std::ranges::copy_if(lines, std::back_inserter(out),
                       [&](const auto& line) { return inside(box, line.from) && inside(box, line.to); });
  return out.empty() ? lines : out;
}

Box box_of(const std::vector<DrawnLine>& lines) {
  Box out{lines.front().from, lines.front().from};
  for (const auto& line : lines) {
    out.low = out.low.cwiseMin(line.from).cwiseMin(line.to);
    out.high = out.high.cwiseMax(line.from).cwiseMax(line.to);
  }
  return out;
}

/// A line as the face of a wall, in metres from the middle of the drawing.
struct Face {
  Vector2d from{0, 0}, to{0, 0};
  std::size_t line{};  ///< of the drawing
  double offset_m{};   ///< to the left of its bin's direction
};

/// The piece of wall between two faces: four corners.
using Quad = std::array<Vector2d, 4>;

std::optional<Quad> between(const Face& a, const Face& b) {
  const Vector2d along = (a.to - a.from).normalized(), across(-along.y(), along.x());
  const double length = (a.to - a.from).norm();
  const auto [b_from, b_to] = std::minmax({along.dot(b.from - a.from), along.dot(b.to - a.from)});
  double from = std::max(0.0, b_from), to = std::min(length, b_to);
  if (to - from < k_min_overlap_m) return std::nullopt;
  const double gap = std::abs(across.dot(0.5 * (b.from + b.to) - a.from));
  if (gap < k_min_wall_m || gap > k_max_wall_m) return std::nullopt;
  // Where two walls meet, the outer faces are longer by the other wall's thickness.
  if (from - std::min(0.0, b_from) <= k_max_wall_m) from = std::min(0.0, b_from);
  if (std::max(length, b_to) - to <= k_max_wall_m) to = std::max(length, b_to);
  const Vector2d other = (b.to - b.from).normalized();
  const auto on_b = [&](double at) {
    const Vector2d foot = a.from + at * along;
    return Vector2d(b.from + other.dot(foot - b.from) * other);
  };
  return Quad{a.from + from * along, a.from + to * along, on_b(to), on_b(from)};
}

/// All sides moved inwards.
Quad shrunk(Quad quad, double by_m) {
  const Vector2d along = by_m * (quad[1] - quad[0]).normalized(),
                 across = by_m * (quad[3] - quad[0]).normalized();
  quad[0] += along + across;
  quad[1] += across - along;
  quad[2] -= along + across;
  quad[3] += along - across;
  return quad;
}

/// Lines that run almost the same way, by the angle of that way in bins.
using Faces = std::map<int, std::vector<Face>>;

const int k_bins = static_cast<int>(std::lround(std::numbers::pi / k_bin_rad));

int bin_of(const Vector2d& direction) {
  double angle = std::atan2(direction.y(), direction.x());
  if (angle < 0) angle += std::numbers::pi;
  return static_cast<int>(std::lround(angle / k_bin_rad)) % k_bins;
}

Faces faces_of(const std::vector<DrawnLine>& lines, const Vector2d& middle, double unit_m) {
  const bool layers = std::ranges::any_of(lines, &DrawnLine::on_wall_layer);
  Faces out;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const auto& line = lines[i];
    if (layers && !line.on_wall_layer) continue;
    const Face face{(line.from - middle) * unit_m, (line.to - middle) * unit_m, i};
    if ((face.to - face.from).norm() < k_min_face_m) continue;
    out[bin_of(face.to - face.from)].push_back(face);
  }
  return out;
}

struct Walls {
  std::vector<Quad> pieces;
  std::vector<bool> is_face;  ///< of each line: drawn as well, it would make its wall thicker
};

Walls walls_of(const Faces& faces, std::size_t lines) {
  Walls out{{}, std::vector<bool>(lines)};
  std::size_t pairs = 0;
  for (const auto& [bin, own] : faces) {
    // With those of the next bin: two faces of one wall may lie on either side of a border.
    std::vector<Face> near = own;
    if (const auto next = faces.find((bin + 1) % k_bins); next != faces.end())
      near.insert(near.end(), next->second.begin(), next->second.end());
    const Vector2d normal(-std::sin(bin * k_bin_rad), std::cos(bin * k_bin_rad));
    double longest = 0;
    for (auto& face : near) {
      face.offset_m = normal.dot(0.5 * (face.from + face.to));
      longest = std::max(longest, (face.to - face.from).norm());
    }
    std::ranges::sort(near, {}, &Face::offset_m);
    const double reach = k_max_wall_m + 2 * longest * k_bin_rad;
    for (std::size_t i = 0; i < near.size(); ++i) {
      for (std::size_t j = i + 1; j < near.size() && near[j].offset_m - near[i].offset_m <= reach; ++j) {
        if (++pairs > k_max_pairs) return out;
        const auto piece = between(near[i], near[j]);
        if (!piece) continue;
        out.pieces.push_back(*piece);
        out.is_face[near[i].line] = out.is_face[near[j].line] = true;
      }
    }
  }
  return out;
}

/// The unit that puts the drawing at its site; 0: none does.
double unit_at(const Vector2d& site_map_m, double unit_m, const Box& box) {
  constexpr double k_near_m = 5000;
  for (const double unit : {unit_m, 1.0, 0.001, 0.01, 0.3048})
    if (unit > 0 && (0.5 * unit * (box.low + box.high) - site_map_m).norm() < k_near_m) return unit;
  return 0;
}

}  // namespace

Result<DrawnPlan> draw_plan(const Drawing& drawing, const std::optional<Vector2d>& site_map_m) {
  const auto lines = drawing.lines.empty() ? drawing.lines : without_strays(drawing.lines);
  const auto nothing =
      make_error(Errc::weak_geometry, "the drawing has no size: all its lines are at one point");
  if (lines.empty()) return nothing;
  const auto box = box_of(lines);
  if (box.longest() <= 0) return nothing;
  DrawnPlan out;
  const double at_site_m = site_map_m ? unit_at(*site_map_m, drawing.unit_m, box) : 0;
  out.is_at_site = at_site_m > 0;
  const double unit_m = out.is_at_site          ? at_site_m
                        : drawing.unit_m > 0    ? drawing.unit_m
                        : box.longest() < 1'000 ? 1
                                                : 0.001;
  const double pixel_m = std::max(k_pixel_m, box.longest() * unit_m / k_longest_px);
  const Vector2d size = (box.high - box.low) * unit_m / pixel_m;
  const cv::Size pixels(static_cast<int>(std::ceil(size.x())) + 2 * k_margin_px,
                        static_cast<int>(std::ceil(size.y())) + 2 * k_margin_px);
  out.drawing_m_from_pixel << pixel_m, 0, box.low.x() * unit_m - k_margin_px * pixel_m,  //
      0, -pixel_m, box.high.y() * unit_m + k_margin_px * pixel_m;
  const Vector2d middle = 0.5 * (box.low + box.high);
  // OpenCV takes fixed-point pixels, whose number names the pixel's middle.
  constexpr int k_shift = 4;
  const auto pixel = [&](const Vector2d& m) {
    const Vector2d half = 0.5 * (box.high - box.low) * unit_m;
    const double x = (m.x() + half.x()) / pixel_m + k_margin_px - 0.5,
                 y = (half.y() - m.y()) / pixel_m + k_margin_px - 0.5;
    return cv::Point(static_cast<int>(std::lround(x * (1 << k_shift))),
                     static_cast<int>(std::lround(y * (1 << k_shift))));
  };
  cv::Mat paper(pixels, CV_8UC3, cv::Scalar(255, 255, 255));
  const cv::Scalar ink(0, 0, 0);
  const auto walls = walls_of(faces_of(lines, middle, unit_m), lines.size());
  for (const auto& piece : walls.pieces) {
    const auto quad = shrunk(piece, 0.5 * pixel_m);  // every pixel that is touched is filled
    const std::array<cv::Point, 4> corners{pixel(quad[0]), pixel(quad[1]), pixel(quad[2]), pixel(quad[3])};
    cv::fillConvexPoly(paper, corners.data(), 4, ink, cv::LINE_AA, k_shift);
  }
  for (std::size_t i = 0; i < lines.size(); ++i)
    if (!walls.is_face[i])
      cv::line(paper, pixel((lines[i].from - middle) * unit_m), pixel((lines[i].to - middle) * unit_m), ink,
               1, cv::LINE_AA, k_shift);
  out.image = {paper.cols, paper.rows, 3, {}};
  out.image.pixels.assign(paper.datastart, paper.dataend);
  return out;
}

}  // namespace anchord::floor_plan
