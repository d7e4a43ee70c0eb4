// A plan in tiles: where each of its pixels lies, on every level, and what no tile is made of.
#include "core/floor_plan/tiles.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "core/floor_plan/image_head.hpp"

namespace anchord::floor_plan::tiles_test {
namespace {

constexpr double k_scale_m = 0.02;
constexpr int k_width = 1500, k_height = 1000, k_mark = 24;
/// Upper left corners of black squares of k_mark pixels, in pixels of the plan.
const std::vector<Eigen::Vector2d> k_marks{{40, 60}, {1300, 90}, {700, 480}, {1420, 930}};

Image marked() {
  Image image{k_width, k_height, 3, std::vector<std::uint8_t>(3u * k_width * k_height, 255)};
  for (const auto& mark : k_marks)
    for (int y = 0; y < k_mark; ++y)
      for (int x = 0; x < 3 * k_mark; ++x)
        image.pixels[static_cast<std::size_t>(3 * ((mark.y() + y) * k_width + mark.x()) + x)] = 0;
  return image;
}

/// The plan's upper left corner at (100, 50) m, its x axis turned so far from east, counter-clockwise.
PlanTransform turned(double deg) {
  const double c = k_scale_m * std::cos(deg * std::numbers::pi / 180),
               s = k_scale_m * std::sin(deg * std::numbers::pi / 180);
  PlanTransform out;
  out.linear << c, s, s, -c;
  out.shift_m = {100, 50};
  return out;
}

std::map<std::pair<int, int>, Image> decoded(const TilePyramid& pyramid, int level) {
  std::map<std::pair<int, int>, Image> out;
  for (const auto& tile : pyramid.tiles) {
    if (tile.level != level) continue;
    auto image = decode_image(std::as_bytes(std::span(tile.png)));
    EXPECT_TRUE(image && image.value().width_px == k_tile_px && image.value().height_px == k_tile_px);
    EXPECT_TRUE(out.emplace(std::pair(tile.column, tile.row), std::move(image).value()).second);
  }
  return out;
}

/// Where the ink near a place of a level has its middle, in pixels of that level from the north-west corner.
Eigen::Vector2d middle_of_ink(const std::map<std::pair<int, int>, Image>& tiles, const Eigen::Vector2d& near,
                              double within) {
  Eigen::Vector2d sum(0, 0);
  double weight = 0;
  for (int y = static_cast<int>(near.y() - within); y <= near.y() + within; ++y) {
    for (int x = static_cast<int>(near.x() - within); x <= near.x() + within; ++x) {
      if (x < 0 || y < 0) continue;
      const auto found = tiles.find({x / k_tile_px, y / k_tile_px});
      if (found == tiles.end()) continue;
      const auto at = 3 * ((y % k_tile_px) * k_tile_px + x % k_tile_px);
      const double ink = 255 - found->second.pixels[static_cast<std::size_t>(at)];
      sum += ink * Eigen::Vector2d(x + 0.5, y + 0.5);
      weight += ink;
    }
  }
  return sum / weight;
}

class PlanTiles : public testing::TestWithParam<double> {};

TEST_P(PlanTiles, HaveAMarkAtItsPixelOfItsTileOnEveryLevel) {
  const double a = GetParam() * std::numbers::pi / 180;
  const auto made = make_tiles(marked(), turned(GetParam()));
  ASSERT_TRUE(made) << made.error().message;
  const auto& pyramid = made.value();
  // By hand: 30 x 20 m; the upper left corner is the furthest west, the upper right one the furthest north.
  EXPECT_NEAR(pyramid.north_west_m.x(), 100, 1e-9);
  EXPECT_NEAR(pyramid.north_west_m.y(), 50 + 30 * std::sin(a), 1e-9);
  EXPECT_NEAR(pyramid.m_per_px, k_scale_m, 1e-12);
  ASSERT_EQ(pyramid.n_levels, 4);
  for (int level = 0; level < pyramid.n_levels; ++level) {
    const auto tiles = decoded(pyramid, level);
    const double m_per_px = k_scale_m * std::pow(2, 3 - level);
    for (const auto& mark : k_marks) {
      const double x_m = k_scale_m * (mark.x() + k_mark / 2.0), y_m = k_scale_m * (mark.y() + k_mark / 2.0);
      const Eigen::Vector2d enu_m(100 + x_m * std::cos(a) + y_m * std::sin(a),
                                  50 + x_m * std::sin(a) - y_m * std::cos(a));
      const Eigen::Vector2d expected((enu_m.x() - pyramid.north_west_m.x()) / m_per_px,
                                     (pyramid.north_west_m.y() - enu_m.y()) / m_per_px);
      const auto found = middle_of_ink(tiles, expected, k_mark * k_scale_m / m_per_px + 2);
      EXPECT_LT((found - expected).norm(), 0.1) << "level " << level << ", mark at " << mark.transpose();
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Turned, PlanTiles, testing::Values(0.0, 30.0));

TEST(PlanTilePyramid, HalvesUntilOneTileHoldsThePlan) {
  const auto pyramid = make_tiles(marked(), turned(0)).value();
  EXPECT_EQ(pyramid.width_px, 1500);
  EXPECT_EQ(pyramid.height_px, 1000);
  ASSERT_EQ(pyramid.n_levels, 4);
  std::map<int, int> count;
  for (const auto& tile : pyramid.tiles) ++count[tile.level];
  // Of 2048, 1024, 512 and 256 pixels of the plan a side.
  EXPECT_EQ(count, (std::map<int, int>{{0, 1}, {1, 2 * 1}, {2, 3 * 2}, {3, 6 * 4}}));
  for (const auto& [level, columns, rows] :
       std::vector<std::array<int, 3>>{{0, 1, 1}, {1, 2, 1}, {2, 3, 2}, {3, 6, 4}}) {
    EXPECT_EQ(tiles_across(1500, 4, level), columns);
    EXPECT_EQ(tiles_across(1000, 4, level), rows);
  }
}

TEST(PlanTilePyramid, OfAPlanSmallerThanATileIsThatTile) {
  Image dot{3, 2, 3, std::vector<std::uint8_t>(18, 0)};
  const auto pyramid = make_tiles(dot, turned(0)).value();
  ASSERT_EQ(pyramid.tiles.size(), 1u);
  EXPECT_EQ(pyramid.n_levels, 1);
  const auto image = decode_image(std::as_bytes(std::span(pyramid.tiles[0].png))).value();
  EXPECT_EQ(std::count(image.pixels.begin(), image.pixels.end(), 0), 18) << "the rest is transparent";
}

TEST(PlanTilePyramid, HasNoTileThatNothingOfThePlanLiesOn) {
  const auto pyramid = make_tiles(marked(), turned(45)).value();
  const auto last = decoded(pyramid, pyramid.n_levels - 1);
  const auto columns = tiles_across(pyramid.width_px, pyramid.n_levels, pyramid.n_levels - 1);
  EXPECT_FALSE(last.contains({0, 0})) << "north-west of a square on its corner is empty";
  EXPECT_TRUE(last.contains({static_cast<int>(columns) / 2, static_cast<int>(columns) / 2}));
  EXPECT_LT(last.size(), static_cast<std::size_t>(columns * columns) * 3 / 4);
}

TEST(PlanTilePyramid, HasLargerPixelsWhereItWouldTakeTooManyBytes) {
  Image noise{1024, 512, 3, {}};
  std::uint32_t state = 1;
  for (int i = 0; i < 3 * 1024 * 512; ++i)
    noise.pixels.push_back(static_cast<std::uint8_t>((state = state * 1664525 + 1013904223) >> 24));
  EXPECT_EQ(make_tiles(noise, turned(0)).value().n_levels, 3);
  const auto less = make_tiles(noise, turned(0), 700'000).value();
  EXPECT_EQ(less.n_levels, 2);
  EXPECT_NEAR(less.m_per_px, 2 * k_scale_m, 1e-12);
  EXPECT_EQ(less.width_px, 512);
  std::size_t bytes = 0;
  for (const auto& tile : less.tiles) bytes += tile.png.size();
  EXPECT_EQ(less.tiles.size(), 3u);
  EXPECT_LE(bytes, 700'000u);
  EXPECT_EQ(make_tiles(noise, turned(0), 100).error().code, Errc::invalid_argument);
}

TEST(PlanTilePyramid, RefusesAPlanOfFiveKilometres) {
  auto far = turned(10);
  far.linear *= 1000;
  EXPECT_EQ(make_tiles(marked(), far).error().code, Errc::invalid_argument);
}

}  // namespace
}  // namespace anchord::floor_plan::tiles_test
