#include "core/floor_plan/wall_faces.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "core/base/axes.hpp"
#include "core/base/median.hpp"

namespace anchord::floor_plan {
namespace {

/// Ends of a piece may move by this much when it is turned to a main direction.
constexpr double k_turn_end_m = 0.03;
/// Pieces too short to have a direction of their own are turned over a wider angle.
constexpr double k_short_m = 0.6, k_short_turn_rad = 0.14;

using Points = std::vector<Eigen::Vector2d>;

Eigen::Vector2d perpendicular(const Eigen::Vector2d& v) { return {-v.y(), v.x()}; }

/// The middle of the sorted projections: a sill or a door's reveal on the face moves it little.
double median_offset(const Points& points, const Eigen::Vector2d& at, const Eigen::Vector2d& normal) {
  std::vector<double> offsets;
  for (const auto& p : points) offsets.push_back(normal.dot(p - at));
  return median(offsets);
}

/// The nearest of the four main directions to `angle`.
double turned_to(double angle, double main_rad) {
  constexpr double quarter = std::numbers::pi / 2;
  return main_rad + quarter * std::round((angle - main_rad) / quarter);
}

Face fit(const Points& points, const Eigen::Vector2d& begin, const Eigen::Vector2d& end,
         std::optional<double> main_rad, double turn_rad) {
  Face face;
  for (const auto& p : points) face.at_m += p / static_cast<double>(points.size());
  Eigen::Matrix2d scatter = Eigen::Matrix2d::Zero();
  for (const auto& p : points) scatter += (p - face.at_m) * (p - face.at_m).transpose();
  const auto eigen = axes_of<2>(scatter);
  const Eigen::Vector2d chord = end - begin;
  face.along = points.size() > 4 ? Eigen::Vector2d(eigen.eigenvectors().col(1)) : chord.normalized();
  if (face.along.dot(chord) < 0) face.along = -face.along;
  if (main_rad) {
    const double angle = std::atan2(face.along.y(), face.along.x()), to = turned_to(angle, *main_rad);
    const double turn = std::abs(std::remainder(angle - to, 2 * std::numbers::pi));
    if (turn < turn_rad || std::sin(turn) * chord.norm() / 2 < k_turn_end_m ||
        (chord.norm() < k_short_m && turn < k_short_turn_rad))
      face.along = {std::cos(to), std::sin(to)};
  }
  const Eigen::Vector2d normal = perpendicular(face.along);
  face.at_m += median_offset(points, face.at_m, normal) * normal;
  face.from_m = face.along.dot(begin - face.at_m);
  face.to_m = face.along.dot(end - face.at_m);
  return face;
}

/// Pieces of one contour: its corners by Douglas and Peucker, a line through what is between them.
std::vector<Face> pieces(const std::vector<cv::Point>& contour, const Mask& mask, const FaceOptions& options,
                         std::optional<double> main_rad) {
  std::vector<cv::Point> corners;
  cv::approxPolyDP(contour, corners, options.tolerance_m / mask.cell_m, true);
  std::vector<Face> out;
  if (corners.size() < 3) return out;
  const std::size_t n = contour.size();
  const auto metres = [&](std::size_t i) {
    const auto& p = contour[i % n];
    return Eigen::Vector2d((p.x + 0.5) * mask.cell_m, (p.y + 0.5) * mask.cell_m);
  };
  // The corners are points of the contour, in its order; the contour may pass a pixel twice.
  std::vector<std::size_t> at;
  std::size_t i = 0;
  while (i < n && contour[i] != corners[0]) ++i;
  for (const auto& corner : corners) {
    while (i < 2 * n && contour[i % n] != corner) ++i;
    if (i >= 2 * n) return out;
    at.push_back(i);
  }
  at.push_back(at.front() + n);
  for (std::size_t k = 0; k + 1 < at.size(); ++k) {
    if (at[k + 1] <= at[k]) continue;
    const std::size_t count = at[k + 1] - at[k];
    const auto trim = std::min(static_cast<std::size_t>(options.trim_m / mask.cell_m), count / 4);
    Points points;
    for (std::size_t j = at[k] + trim; j <= at[k + 1] - trim; ++j) points.push_back(metres(j));
    auto face = fit(points, metres(at[k]), metres(at[k + 1]), main_rad, options.turn_rad);
    const Eigen::Vector2d normal = perpendicular(face.along);
    const Eigen::Vector2d middle = face.at_m + 0.5 * (face.from_m + face.to_m) * face.along;
    face.to_ink = mask.at(middle + 1.5 * mask.cell_m * normal) ? normal : Eigen::Vector2d(-normal);
    // The contour runs through the middles of the outermost ink.
    face.at_m -= 0.5 * mask.cell_m * face.to_ink;
    out.push_back(face);
  }
  return out;
}

}  // namespace

double ink_along(const Mask& mask, const Eigen::Vector2d& a_m, const Eigen::Vector2d& b_m) {
  const int n = std::max(2, static_cast<int>(std::ceil((b_m - a_m).norm() / mask.cell_m)));
  int ink = 0;
  for (int i = 0; i < n; ++i)
    if (mask.at(a_m + (i + 0.5) / n * (b_m - a_m))) ++ink;
  return static_cast<double>(ink) / n;
}

std::vector<std::vector<Face>> faces_of(const Mask& mask, const FaceOptions& options,
                                        std::optional<double> main_rad) {
  const cv::Mat image(mask.rows, mask.columns, CV_8U, const_cast<std::uint8_t*>(mask.ink.data()));
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(image, contours, options.outer_only ? cv::RETR_EXTERNAL : cv::RETR_CCOMP,
                   cv::CHAIN_APPROX_NONE);
  std::vector<std::vector<Face>> out;
  std::size_t total = 0;
  for (const auto& contour : contours) {
    out.push_back(pieces(contour, mask, options, main_rad));
    total += out.back().size();
    if (total > options.most) break;
  }
  return out;
}

double main_direction_rad(const std::vector<std::vector<Face>>& contours) {
  // Four times the angle is the same for all four main directions; longer pieces know theirs better. Slanted
  // walls are others' business: what lies farther from the direction found than this is left out of the next.
  double main = 0;
  for (const double within_rad : {1.0, 0.2, 0.05, 0.02}) {
    std::complex<double> sum = 0;
    for (const auto& contour : contours) {
      for (const auto& face : contour) {
        const double angle = std::atan2(face.along.y(), face.along.x());
        if (std::abs(angle - turned_to(angle, main)) > within_rad) continue;
        sum += std::pow(face.length_m(), 2) * std::polar(1.0, 4 * angle);
      }
    }
    if (std::abs(sum) > 0) main = std::arg(sum) / 4;
  }
  return main;
}

}  // namespace anchord::floor_plan
