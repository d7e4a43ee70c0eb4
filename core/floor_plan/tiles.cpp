#include "core/floor_plan/tiles.hpp"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "core/floor_plan/backdrop.hpp"

namespace anchord::floor_plan {
namespace {

/// Longer than the diagonal of the largest plan: only a skew that no plan has would need more pixels.
constexpr double k_longest_side_px = 45'000;

const cv::Scalar k_nothing(255, 255, 255, 0);

/// The pyramid from its last level down to its first, one branch after the other.
class Maker {
 public:
  Maker(const Image& rgb, const PlanTransform& transform, TilePyramid& out, int left_out,
        std::size_t max_bytes)
      : source_(rgb.height_px, rgb.width_px, CV_8UC3, const_cast<std::uint8_t*>(rgb.pixels.data())),
        last_m_per_px_(out.m_per_px),
        out_(out),
        left_out_(left_out),
        room_(max_bytes) {
    const Eigen::Matrix2d inverse = transform.linear.inverse();
    pixel_from_last_ = inverse * Eigen::Vector2d(last_m_per_px_, -last_m_per_px_).asDiagonal();
    corner_px_ = inverse * (out.north_west_m - transform.shift_m);
  }

  /// False where the tiles take more bytes than they may.
  Result<bool> make() {
    BOOST_OUTCOME_TRYV(tile(0, 0, 0));
    return room_ != 0;
  }

 private:
  using Pixels = std::optional<cv::Mat>;

  /// Nothing where nothing of the plan lies on it, or there is no room for more.
  Result<Pixels> tile(int level, std::int64_t column, std::int64_t row) {
    if (room_ == 0) return Pixels();
    Pixels made;
    if (level + 1 == out_.n_levels) {
      made = warped(column, row);
    } else {
      BOOST_OUTCOME_TRY(made, halved(level, column, row));
    }
    if (made && level < out_.n_levels - left_out_) {
      BOOST_OUTCOME_TRY(auto png, encoded(*made));
      room_ -= std::min(room_, png.size());
      out_.tiles.push_back({level, static_cast<int>(column), static_cast<int>(row), std::move(png)});
    }
    return made;
  }

  Result<Pixels> halved(int level, std::int64_t column, std::int64_t row) {
    const auto columns = tiles_across(out_.width_px, out_.n_levels, level + 1),
               rows = tiles_across(out_.height_px, out_.n_levels, level + 1);
    cv::Mat four;
    for (const int y : {0, 1}) {
      for (const int x : {0, 1}) {
        if (2 * column + x >= columns || 2 * row + y >= rows) continue;
        BOOST_OUTCOME_TRY(const auto one, tile(level + 1, 2 * column + x, 2 * row + y));
        if (!one) continue;
        if (four.empty()) four = cv::Mat(2 * k_tile_px, 2 * k_tile_px, CV_8UC4, k_nothing);
        one->copyTo(four(cv::Rect(x * k_tile_px, y * k_tile_px, k_tile_px, k_tile_px)));
      }
    }
    if (four.empty()) return Pixels();
    cv::Mat out;
    cv::resize(four, out, cv::Size(k_tile_px, k_tile_px), 0, 0, cv::INTER_AREA);
    return Pixels(out);
  }

  Pixels warped(std::int64_t column, std::int64_t row) const {
    const Eigen::Vector2d first(static_cast<double>(column * k_tile_px),
                                static_cast<double>(row * k_tile_px));
    Eigen::AlignedBox<double, 2> seen;
    for (const Eigen::Vector2d& corner :
         {Eigen::Vector2d(0, 0), Eigen::Vector2d(k_tile_px, 0), Eigen::Vector2d(0, k_tile_px),
          Eigen::Vector2d(k_tile_px, k_tile_px)})
      seen.extend(corner_px_ + pixel_from_last_ * (first + corner));
    const Eigen::AlignedBox<double, 2> plan(Eigen::Vector2d(0, 0),
                                            Eigen::Vector2d(source_.cols, source_.rows));
    if (!seen.intersects(plan)) return std::nullopt;
    // From the middle of a pixel of the tile to the middle of one of the plan.
    const auto& m = pixel_from_last_;
    const Eigen::Vector2d at =
        corner_px_ + m * (first + Eigen::Vector2d(0.5, 0.5)) - Eigen::Vector2d(0.5, 0.5);
    cv::Mat rgb, out;
    cv::warpAffine(source_, rgb, cv::Matx23d(m(0, 0), m(0, 1), at.x(), m(1, 0), m(1, 1), at.y()),
                   cv::Size(k_tile_px, k_tile_px), cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                   cv::BORDER_REPLICATE);
    cv::cvtColor(rgb, out, cv::COLOR_RGB2RGBA);
    if (plan.contains(seen)) return out;
    return cut_out(out, at) ? Pixels(out) : std::nullopt;
  }

  /// Transparent where a pixel's middle is beside the plan. False where all are.
  bool cut_out(cv::Mat& tile, const Eigen::Vector2d& at) const {
    const auto& m = pixel_from_last_;
    bool any = false;
    for (int y = 0; y < k_tile_px; ++y) {
      for (int x = 0; x < k_tile_px; ++x) {
        const Eigen::Vector2d p = at + m * Eigen::Vector2d(x, y);
        if (p.x() >= -0.5 && p.y() >= -0.5 && p.x() < source_.cols - 0.5 && p.y() < source_.rows - 0.5)
          any = true;
        else
          tile.at<cv::Vec4b>(y, x) = {255, 255, 255, 0};
      }
    }
    return any;
  }

  /// In as few channels as it needs: most plans are grey.
  static Result<std::string> encoded(const cv::Mat& tile) {
    bool opaque = true, grey = true;
    for (int y = 0; y < k_tile_px && (opaque || grey); ++y) {
      for (int x = 0; x < k_tile_px; ++x) {
        const auto& p = tile.at<cv::Vec4b>(y, x);
        opaque = opaque && p[3] == 255;
        grey = grey && p[0] == p[1] && p[1] == p[2];
      }
    }
    const int channels = !opaque ? 4 : grey ? 1 : 3;
    Image image{k_tile_px, k_tile_px, channels, {}};
    image.pixels.resize(static_cast<std::size_t>(channels) * k_tile_px * k_tile_px);
    cv::Mat to(k_tile_px, k_tile_px, CV_8UC(channels), image.pixels.data());
    if (channels == 4)
      tile.copyTo(to);
    else if (channels == 3)
      cv::cvtColor(tile, to, cv::COLOR_RGBA2RGB);
    else
      cv::extractChannel(tile, to, 0);
    return encode_png(image, PngEffort::fast);
  }

  const cv::Mat source_;
  const double last_m_per_px_;
  TilePyramid& out_;
  const int left_out_;
  std::size_t room_;
  Eigen::Matrix2d pixel_from_last_;
  Eigen::Vector2d corner_px_;
};

/// Pixels of `m_per_px` over a length; what is a millionth of a tile beyond the last one is rounding.
std::int64_t pixels_over(double length_m, double m_per_px) {
  return std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(length_m / m_per_px - 1e-3)));
}

}  // namespace

std::int64_t tiles_across(std::int64_t last_level_px, int n_levels, int level) {
  const std::int64_t px = std::int64_t{k_tile_px} << (n_levels - 1 - level);
  return (last_level_px + px - 1) / px;
}

Result<TilePyramid> make_tiles(const Image& rgb, const PlanTransform& transform, std::size_t max_bytes) {
  BOOST_OUTCOME_TRY(const auto covered, extent_of(rgb, transform));
  const Eigen::Vector2d size_m = covered.high_m - covered.low_m;
  TilePyramid whole;
  whole.north_west_m = {covered.low_m.x(), covered.high_m.y()};
  whole.m_per_px = std::max(transform.scale_m_per_px(), size_m.maxCoeff() / k_longest_side_px);
  whole.width_px = pixels_over(size_m.x(), whole.m_per_px);
  whole.height_px = pixels_over(size_m.y(), whole.m_per_px);
  whole.n_levels = 1;
  while (tiles_across(std::max(whole.width_px, whole.height_px), whole.n_levels, 0) > 1) ++whole.n_levels;
  for (int left_out = 0; left_out < whole.n_levels; ++left_out) {
    TilePyramid out = whole;
    BOOST_OUTCOME_TRY(const bool fits, Maker(rgb, transform, out, left_out, max_bytes).make());
    if (!fits) continue;
    const std::int64_t by = std::int64_t{1} << left_out;
    out.m_per_px *= static_cast<double>(by);
    out.width_px = (out.width_px + by - 1) / by;
    out.height_px = (out.height_px + by - 1) / by;
    out.n_levels -= left_out;
    return out;
  }
  return make_error(Errc::invalid_argument,
                    "even one tile of the plan takes more than " + std::to_string(max_bytes) + " bytes");
}

}  // namespace anchord::floor_plan
