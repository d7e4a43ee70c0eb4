// Plans drawn by the test: an L-shaped floor with outer walls of 30 cm, partitions of 12 cm, doors, windows,
// furniture, text, dimension lines, a title block and specks of dust; turned, at several scales. Truth is the
// geometry that was drawn.
#include "core/floor_plan/trace.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

namespace anchord::floor_plan::trace_test {
namespace {

using Point = Eigen::Vector2d;
using Line = std::pair<Point, Point>;

constexpr double k_outer_m = 0.30, k_inner_m = 0.12;
constexpr int k_sixteenths = 4;

double distance(const Point& p, const Line& line) {
  const Point along = line.second - line.first;
  const double t = std::clamp(along.dot(p - line.first) / along.squaredNorm(), 0.0, 1.0);
  return (line.first + t * along - p).norm();
}
double nearest(const Point& p, const std::vector<Line>& lines) {
  double best = 1e9;
  for (const auto& line : lines) best = std::min(best, distance(p, line));
  return best;
}
/// Points of the lines, 2 cm apart.
std::vector<Point> samples(const std::vector<Line>& lines) {
  std::vector<Point> out;
  for (const auto& [a, b] : lines) {
    const int n = std::max(1, static_cast<int>((b - a).norm() / 0.02));
    for (int i = 0; i <= n; ++i) out.push_back(a + static_cast<double>(i) / n * (b - a));
  }
  return out;
}
std::vector<Line> closed(const std::vector<Point>& corners) {
  std::vector<Line> out;
  for (std::size_t i = 0; i < corners.size(); ++i)
    out.emplace_back(corners[i], corners[(i + 1) % corners.size()]);
  return out;
}

/// Draws metres of the sheet (x right, y down), the building turned about its middle. Drawn four times finer
/// and averaged, as a scanner does: every edge lies where it was meant within a hundredth of a pixel.
class Sheet {
 public:
  Sheet(double width_m, double height_m, double m_per_px, double turn_rad)
      : fine_m_(m_per_px / k_finer),
        turn_(turn_rad),
        fine_(static_cast<int>(height_m / m_per_px) * k_finer, static_cast<int>(width_m / m_per_px) * k_finer,
              CV_8U, cv::Scalar(250)),
        middle_(width_m / 2, height_m / 2) {}
  Point turned(const Point& m) const {
    return middle_ + Eigen::Rotation2D<double>(turn_) * (m - Point(12, 8));
  }
  void fill(const std::vector<Point>& corners, int grey = 20) {
    std::vector<cv::Point> px;
    for (const auto& m : corners) px.push_back(at(m));
    const std::vector<std::vector<cv::Point>> all{px};
    cv::fillPoly(fine_, all, cv::Scalar(grey), cv::LINE_8, k_sixteenths);
  }
  void wall(const Line& middle, double thickness_m, int grey = 20) {
    const Point along = (middle.second - middle.first).normalized(),
                side = thickness_m / 2 * Point(-along.y(), along.x());
    fill({middle.first + side, middle.second + side, middle.second - side, middle.first - side}, grey);
  }
  /// A stroke as thin as pens are: 2.5 cm on the ground.
  void stroke(const std::vector<Point>& points) {
    for (std::size_t i = 0; i + 1 < points.size(); ++i) wall({points[i], points[i + 1]}, 0.025, 40);
  }
  void text(const Point& m, const char* words, double height_m, double pen_m = 0.025) {
    const auto p = at(m);
    cv::putText(fine_, words, {p.x >> k_sixteenths, p.y >> k_sixteenths}, cv::FONT_HERSHEY_SIMPLEX,
                height_m / fine_m_ / 22, cv::Scalar(30), std::max(1, static_cast<int>(pen_m / fine_m_)));
  }
  void dot(const Point& m, double radius_m) {
    cv::circle(fine_, at(m), static_cast<int>(radius_m / fine_m_ * (1 << k_sixteenths)), cv::Scalar(60),
               cv::FILLED, cv::LINE_8, k_sixteenths);
  }
  Image rgb(std::mt19937& chance, int dust) const {
    cv::Mat grey, colours;
    cv::resize(fine_, grey, {fine_.cols / k_finer, fine_.rows / k_finer}, 0, 0, cv::INTER_AREA);
    for (int i = 0; i < dust; ++i)
      grey.at<std::uint8_t>(static_cast<int>(chance() % static_cast<unsigned>(grey.rows)),
                            static_cast<int>(chance() % static_cast<unsigned>(grey.cols))) = 90;
    cv::cvtColor(grey, colours, cv::COLOR_GRAY2RGB);
    return {colours.cols, colours.rows, 3, {colours.datastart, colours.dataend}};
  }

 private:
  /// OpenCV's whole numbers are the middles of pixels.
  cv::Point at(const Point& m) const {
    const Point p = (turned(m) / fine_m_ - Point(0.5, 0.5)) * (1 << k_sixteenths);
    return {static_cast<int>(std::lround(p.x())), static_cast<int>(std::lround(p.y()))};
  }
  static constexpr int k_finer = 4;
  double fine_m_, turn_;
  cv::Mat fine_;
  Point middle_;
};

struct Drawn {
  Image image;
  PlanTransform transform;
  std::vector<Line> outline, walls;  ///< ENU
};

/// The wall without its openings, each given by its middle and width along it.
void build(Sheet& sheet, std::vector<Line>& walls, const Line& middle, double thickness_m, double past_m,
           const std::vector<std::pair<double, double>>& openings, bool windows) {
  const Point along = (middle.second - middle.first).normalized();
  const double length = (middle.second - middle.first).norm();
  double from = 0;
  auto piece = [&](double a, double b) {
    walls.emplace_back(middle.first + a * along, middle.first + b * along);
    // Corners are filled: the outer walls reach half a wall past the corner of their middle lines.
    sheet.wall({middle.first + (a == 0 ? -past_m : a) * along,
                middle.first + (b == length ? length + past_m : b) * along},
               thickness_m);
  };
  for (const auto& [at, width] : openings) {
    piece(from, at - width / 2);
    from = at + width / 2;
    const Point a = middle.first + (at - width / 2) * along, b = middle.first + (at + width / 2) * along;
    const Point side(-along.y(), along.x());
    if (windows) {
      for (const double off : {-0.4, 0.0, 0.4})
        sheet.stroke({a + off * thickness_m * side, b + off * thickness_m * side});
    } else {  // a door, open, with its swing
      std::vector<Point> swing;
      for (int i = 0; i <= 12; ++i) {
        const double angle = i * std::numbers::pi / 24;
        swing.push_back(a + width * (std::cos(angle) * along + std::sin(angle) * side));
      }
      sheet.stroke(swing);
      sheet.stroke({a, a + width * side});
    }
  }
  piece(from, length);
}

Drawn drawn(unsigned seed, double m_per_px, double turn_deg) {
  std::mt19937 chance(seed);
  auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(chance); };
  Sheet sheet(36, 34, m_per_px, turn_deg * std::numbers::pi / 180);
  Drawn out;
  const std::vector<Point> corners{{0, 0}, {24, 0}, {24, 10}, {14, 10}, {14, 16}, {0, 16}};
  const double h = k_outer_m / 2;
  const std::vector<Point> inset{{h, h},           {24 - h, h},      {24 - h, 10 - h},
                                 {14 - h, 10 - h}, {14 - h, 16 - h}, {h, 16 - h}};
  std::vector<Line> walls;
  // A corridor, and rooms to both sides of it; one wall is slanted.
  const double corridor = between(5, 6), second = corridor + 1.8;
  const std::array<double, 3> rooms{between(5.5, 7), between(12, 13), between(18, 20)};
  const Line slanted{{between(6, 8), second}, {between(6, 8), 16 - h}};
  build(sheet, walls, {{h, corridor}, {24 - h, corridor}}, k_inner_m, 0, {{4, 0.9}, {9.5, 0.9}, {15, 1.0}},
        false);
  build(sheet, walls, {{h, second}, {14 - h, second}}, k_inner_m, 0, {{3, 0.9}, {10, 0.9}}, false);
  for (const double x : rooms)
    build(sheet, walls, {{x, h}, {x, corridor}}, k_inner_m, 0, {{1.2, 0.8}}, false);
  build(sheet, walls, slanted, k_inner_m, 0, {}, false);
  std::vector<Point> joints{slanted.second, {h, corridor}, {24 - h, corridor}, {h, second}};
  for (const double x : rooms) joints.emplace_back(x, h);
  for (std::size_t i = 0; i < inset.size(); ++i) {
    const Line middle{inset[i], inset[(i + 1) % inset.size()]};
    const double length = (middle.second - middle.first).norm();
    std::vector<std::pair<double, double>> openings;
    for (double at = between(1.5, 2.5); at < length - 1.6; at += between(3, 4.5)) {
      const double width = between(1.0, 1.8);
      const Point here = middle.first + at * (middle.second - middle.first) / length;
      // Partitions join walls, not windows.
      if (std::ranges::all_of(joints, [&](const Point& p) { return (p - here).norm() > width / 2 + 0.3; }))
        openings.emplace_back(at, width);
    }
    build(sheet, walls, middle, k_outer_m, h, openings, i != 2);
  }
  // Furniture, letters, a plant, dimensions, a title.
  for (int i = 0; i < 10; ++i) {
    const Point at(between(1, 12), between(1, 4));
    sheet.stroke({at, at + Point(1.4, 0), at + Point(1.4, 0.7), at + Point(0, 0.7), at});
    sheet.text(at + Point(0.1, 0.4), "DESK", 0.18);
  }
  sheet.text({2, 3.8}, "OFFICE 1.12", 0.35);
  sheet.text({16, 8.6}, "WORKSHOP 84 m2", 0.45);
  sheet.dot({2.2, 13.5}, 0.25);
  sheet.fill({{9.5, 12}, {11.5, 12}, {11.5, 13}, {9.5, 13}});  // a filled table
  sheet.stroke({{0, -1.2}, {24, -1.2}});
  sheet.stroke({{-1.2, 0}, {-1.2, 16}});
  sheet.text({10, -1.4}, "24.00", 0.3);
  sheet.text({16, 14}, "GROUND FLOOR 1:100", 0.6, 0.04);
  out.image = sheet.rgb(chance, 2000);
  const double c = std::cos(0.4), s = std::sin(0.4);
  out.transform.linear << m_per_px * c, m_per_px * s, m_per_px * s, -m_per_px * c;
  out.transform.shift_m = {-20, 35};
  const auto enu = [&](const Line& line) {
    return Line{out.transform.enu_from(sheet.turned(line.first) / m_per_px),
                out.transform.enu_from(sheet.turned(line.second) / m_per_px)};
  };
  for (const auto& line : closed(corners)) out.outline.push_back(enu(line));
  for (const auto& line : walls) out.walls.push_back(enu(line));
  return out;
}

struct Case {
  unsigned seed;
  double m_per_px, turn_deg;
};
class TracedPlan : public ::testing::TestWithParam<Case> {};

TEST_P(TracedPlan, HasTheOutlineWithin5CmAnd95PercentOfTheWallsWithin10Cm) {
  const auto [seed, m_per_px, turn_deg] = GetParam();
  const auto plan = drawn(seed, m_per_px, turn_deg);
  const auto trace = trace_plan(plan.image, plan.transform);
  ASSERT_TRUE(trace.has_value()) << trace.error().message;
  std::vector<Line> walls;
  for (const auto& wall : trace.value().walls) walls.emplace_back(wall.from_m, wall.to_m);
  const auto outline = closed(trace.value().outline_m);
  double there = 0, back = 0;
  for (const auto& p : samples(plan.outline)) there = std::max(there, nearest(p, outline));
  for (const auto& p : samples(outline)) back = std::max(back, nearest(p, plan.outline));
  const auto wanted = samples(plan.walls), got = samples(walls);
  const auto share = [](const std::vector<Point>& points, const std::vector<Line>& lines) {
    return static_cast<double>(
               std::ranges::count_if(points, [&](const Point& p) { return nearest(p, lines) <= 0.10; })) /
           static_cast<double>(points.size());
  };
  const double found = share(wanted, walls), real = share(got, plan.walls);
  std::printf(
      "seed %u, %.4f m a pixel, turned %.0f degrees: outline %.3f m (%zu corners), walls %.1f %% found, "
      "%.1f %% of %zu real\n",
      seed, m_per_px, turn_deg, std::max(there, back), trace.value().outline_m.size(), 100 * found,
      100 * real, walls.size());
  EXPECT_LE(there, 0.05);
  EXPECT_LE(back, 0.05);
  EXPECT_EQ(trace.value().outline_m.size(), 6u);  // right angles, no more corners than were drawn
  EXPECT_GE(found, 0.95);
  EXPECT_GE(real, 0.95);
  for (const auto& wall : trace.value().walls) {
    EXPECT_GT(wall.thickness_m, k_inner_m - 0.04);
    EXPECT_LT(wall.thickness_m, k_outer_m + 0.04);
  }
}
INSTANTIATE_TEST_SUITE_P(Seeds, TracedPlan,
                         ::testing::Values(Case{1, 0.0125, 0}, Case{2, 0.0125, 17}, Case{3, 0.02, -33},
                                           Case{4, 0.010, 45}, Case{5, 0.025, 8}));

Image blank(int width, int height, std::uint8_t grey) {
  return {width, height, 3, std::vector<std::uint8_t>(static_cast<std::size_t>(3 * width * height), grey)};
}
PlanTransform scaled(double m_per_px) {
  PlanTransform t;
  t.linear = Eigen::Vector2d(m_per_px, -m_per_px).asDiagonal();
  return t;
}

TEST(PlanTrace, SaysWhyNothingCanBeTraced) {
  EXPECT_EQ(trace_plan(blank(400, 300, 255), scaled(0.02)).error().code, Errc::weak_geometry);
  EXPECT_EQ(trace_plan(blank(400, 300, 10), scaled(0.02)).error().code, Errc::weak_geometry);
  const auto coarse = trace_plan(blank(400, 300, 255), scaled(0.2));
  EXPECT_EQ(coarse.error().code, Errc::invalid_argument);
  EXPECT_NE(coarse.error().message.find("0.06 m"), std::string::npos) << coarse.error().message;
  auto lines = blank(800, 600, 255);  // two walls that meet nothing
  for (int y = 100; y < 110; ++y)
    for (int x = 100; x < 700; ++x)
      for (int c = 0; c < 3; ++c) lines.pixels[static_cast<std::size_t>(3 * (y * 800 + x) + c)] = 0;
  const auto open = trace_plan(lines, scaled(0.02));
  ASSERT_FALSE(open.has_value());
  EXPECT_NE(open.error().message.find("enclose no area"), std::string::npos) << open.error().message;
}

TEST(PlanTrace, EndsWhenItIsToldTo) {
  const auto plan = drawn(1, 0.025, 0);
  const auto trace =
      trace_plan(plan.image, plan.transform, {}, [](double, std::string_view) { return false; });
  EXPECT_EQ(trace.error().code, Errc::canceled);
}

}  // namespace
}  // namespace anchord::floor_plan::trace_test
