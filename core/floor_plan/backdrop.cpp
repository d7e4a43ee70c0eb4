#include "core/floor_plan/backdrop.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace anchord::floor_plan {
namespace {

constexpr double k_max_extent_m = 5000;

/// Averaged, not picked: where several pixels become one, thin lines would else be lost.
cv::Mat reduced(const cv::Mat& from, double by) {
  if (by <= 1.2) return from;
  cv::Mat to;
  cv::resize(from, to, {}, 1 / by, 1 / by, cv::INTER_AREA);
  return to;
}

}  // namespace

Result<Extent> extent_of(const Image& image, const PlanTransform& transform) {
  const double w = image.width_px, h = image.height_px;
  Extent out{transform.enu_from({0, 0}), transform.enu_from({0, 0})};
  for (const Eigen::Vector2d& corner :
       {Eigen::Vector2d(w, 0), Eigen::Vector2d(0, h), Eigen::Vector2d(w, h)}) {
    out.low_m = out.low_m.cwiseMin(transform.enu_from(corner));
    out.high_m = out.high_m.cwiseMax(transform.enu_from(corner));
  }
  const Eigen::Vector2d size_m = out.high_m - out.low_m;
  if (!size_m.allFinite() || size_m.maxCoeff() > k_max_extent_m)
    return make_error(Errc::invalid_argument,
                      "the plan would cover more than 5 km: check its points, or the unit of its map file");
  return out;
}

Result<Backdrop> make_backdrop(const Image& rgb, const PlanTransform& transform, int longest_side_px) {
  BOOST_OUTCOME_TRY(const auto covered, extent_of(rgb, transform));
  Backdrop out;
  out.low_m = covered.low_m;
  out.high_m = covered.high_m;
  const double w = rgb.width_px, h = rgb.height_px;
  const Eigen::Vector2d extent = out.high_m - out.low_m;
  const double cell = std::max(transform.scale_m_per_px(), extent.maxCoeff() / longest_side_px);
  const int columns = std::clamp(static_cast<int>(std::ceil(extent.x() / cell)), 1, longest_side_px);
  const int rows = std::clamp(static_cast<int>(std::ceil(extent.y() / cell)), 1, longest_side_px);
  const cv::Mat source(rgb.height_px, rgb.width_px, CV_8UC3, const_cast<std::uint8_t*>(rgb.pixels.data()));
  const cv::Mat small = reduced(source, cell / transform.scale_m_per_px());
  const double sx = small.cols / w, sy = small.rows / h;
  // From the middle of a cell of the backdrop to the middle of a pixel of `small`.
  const Eigen::Matrix2d inverse = transform.linear.inverse();
  const double cell_e = extent.x() / columns, cell_n = extent.y() / rows;
  Eigen::Matrix2d pixel_from_cell = inverse * Eigen::Vector2d(cell_e, -cell_n).asDiagonal();
  Eigen::Vector2d at = inverse * (Eigen::Vector2d(out.low_m.x() + cell_e / 2, out.high_m.y() - cell_n / 2) -
                                  transform.shift_m);
  pixel_from_cell = Eigen::Vector2d(sx, sy).asDiagonal() * pixel_from_cell;
  at = Eigen::Vector2d(sx * at.x() - 0.5, sy * at.y() - 0.5);
  const cv::Matx23d map(pixel_from_cell(0, 0), pixel_from_cell(0, 1), at.x(), pixel_from_cell(1, 0),
                        pixel_from_cell(1, 1), at.y());
  cv::Mat opaque;
  cv::cvtColor(small, opaque, cv::COLOR_RGB2RGBA);
  out.image = {columns, rows, 4, {}};
  out.image.pixels.resize(4 * static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows));
  cv::Mat to(rows, columns, CV_8UC4, out.image.pixels.data());
  cv::warpAffine(opaque, to, map, to.size(), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP, cv::BORDER_CONSTANT,
                 cv::Scalar(255, 255, 255, 0));
  return out;
}

}  // namespace anchord::floor_plan
