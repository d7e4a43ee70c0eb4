// DXF drawings: what is read of them, how they are drawn, and that a traced drawing is the building.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

#include "core/floor_plan/draw.hpp"
#include "core/floor_plan/dxf.hpp"
#include "core/floor_plan/trace.hpp"
#include "tests/core/floor_plan/drawings.hpp"

namespace anchord::floor_plan::drawing_test {
namespace {

using Eigen::Vector2d;

std::span<const std::byte> bytes(const std::string& text) { return std::as_bytes(std::span(text)); }

Drawing drawing(const std::string& text) {
  auto read = read_dxf(bytes(text));
  EXPECT_TRUE(read.has_value()) << read.error().message;
  return read ? std::move(read).value() : Drawing{};
}

double total_length(const Drawing& d) {
  double sum = 0;
  for (const auto& line : d.lines) sum += (line.to - line.from).norm();
  return sum;
}

TEST(Dxf, IsKnownByItsFirstGroup) {
  EXPECT_TRUE(is_dxf(bytes("  0\r\nSECTION\r\n  2\r\nHEADER\r\n")));
  EXPECT_TRUE(is_dxf(bytes("999\nmade by a CAD\n0\nSECTION\n")));
  EXPECT_TRUE(
      is_dxf(bytes("\xef\xbb\xbf"
                   "0\nSECTION\n")));
  for (const char* other : {"", "0", "0\nEOF\n", "%PDF-1.7", "AC1027", "<svg>", "1\nSECTION\n"})
    EXPECT_FALSE(is_dxf(bytes(other))) << other;
}

TEST(Dxf, HasItsUnitAndLines) {
  const auto d = drawing(dxf::header(4) + dxf::entities(dxf::line("0", 0, 0, 3000, 4000)));
  EXPECT_EQ(d.unit_m, 0.001);
  ASSERT_EQ(d.lines.size(), 1u);
  EXPECT_EQ(d.lines[0].to, Vector2d(3000, 4000));
  EXPECT_EQ(drawing(dxf::entities(dxf::line("0", 0, 0, 1, 0))).unit_m, 0) << "the file does not say";
}

// DXF reference, $INSUNITS; a survey foot is 1200/3937 m (NIST SP 811, B.6).
TEST(Dxf, KnowsEveryUnitOfTheReferenceAndNoOther) {
  const auto unit_m = [](int code) {
    return drawing(dxf::header(code) + dxf::entities(dxf::line("0", 0, 0, 1, 0))).unit_m;
  };
  EXPECT_EQ(unit_m(0), 0) << "unitless";
  for (const auto& [code, metres] : {std::pair{3, 1609.344},
                                     {7, 1000.0},
                                     {8, 2.54e-8},
                                     {9, 2.54e-5},
                                     {10, 0.9144},
                                     {13, 1e-6},
                                     {14, 0.1},
                                     {16, 100.0},
                                     {21, 1200.0 / 3937},
                                     {22, 100.0 / 3937},
                                     {23, 3600.0 / 3937},
                                     {24, 6336000.0 / 3937}})
    EXPECT_NEAR(unit_m(code) / metres, 1, 1e-12) << code;
  for (const int code : {25, 70, -1}) {
    const auto text = dxf::header(code) + dxf::entities(dxf::line("0", 0, 0, 1, 0));
    const auto read = read_dxf(bytes(text));
    ASSERT_FALSE(read.has_value()) << code;
    EXPECT_NE(read.error().message.find("$INSUNITS is " + std::to_string(code)), std::string::npos);
  }
}

// A bulge of 1 is half a circle: DXF reference, LWPOLYLINE group 42. Chords of 5 degrees are 0.03 % shorter.
TEST(Dxf, BulgesAndCirclesAndArcsAreRound) {
  constexpr double k_pi = std::numbers::pi;
  const auto slot =
      drawing(dxf::entities("0\nLWPOLYLINE\n8\n0\n90\n4\n70\n1\n10\n0\n20\n0\n10\n10\n20\n0\n42\n1\n10\n10\n2"
                            "0\n4\n10\n0\n20\n4\n42\n1\n"));
  EXPECT_NEAR(total_length(slot), 20 + 4 * k_pi, 0.01);
  double right = 0;
  for (const auto& line : slot.lines) right = std::max(right, line.to.x());
  EXPECT_NEAR(right, 12, 0.01) << "to the right of the way from (10, 0) to (10, 4)";
  EXPECT_NEAR(total_length(drawing(dxf::entities("0\nCIRCLE\n8\n0\n10\n5\n20\n5\n40\n2\n"))), 4 * k_pi, 0.01);
  EXPECT_NEAR(total_length(drawing(dxf::entities("0\nARC\n8\n0\n10\n0\n20\n0\n40\n1\n50\n350\n51\n80\n"))),
              k_pi / 2, 0.01);
}

TEST(Dxf, BlocksAreWhereTheyAreInserted) {
  const auto block = dxf::block("DOOR", 1, 0, dxf::line("0", 1, 0, 2, 0));
  const auto d =
      drawing(block + dxf::entities("0\nINSERT\n8\nA-WALL\n2\nDOOR\n10\n100\n20\n50\n41\n2\n50\n90\n"));
  ASSERT_EQ(d.lines.size(), 1u);
  EXPECT_LT((d.lines[0].from - Vector2d(100, 50)).norm(), 1e-9);
  EXPECT_LT((d.lines[0].to - Vector2d(100, 52)).norm(), 1e-9);
  EXPECT_TRUE(d.lines[0].on_wall_layer) << "what stands on layer 0 is on the layer of the insert";
  const auto grid = drawing(
      block + dxf::entities("0\nINSERT\n8\n0\n2\nDOOR\n10\n0\n20\n0\n70\n3\n71\n2\n44\n10\n45\n20\n"));
  EXPECT_EQ(grid.lines.size(), 6u);
}

TEST(Dxf, WhatIsSwitchedOffOrOfThePaperIsNotShown) {
  const std::string layers =
      "0\nSECTION\n2\nTABLES\n0\nTABLE\n2\nLAYER\n0\nLAYER\n2\nFROZEN\n70\n1\n62\n7\n0\nLAYER\n2\nOFF\n70\n0"
      "\n62\n-7\n"
      "0\nLAYER\n2\nSEEN\n70\n0\n62\n7\n0\nENDTAB\n0\nENDSEC\n";
  const auto d = drawing(layers + dxf::entities(dxf::line("FROZEN", 0, 0, 1, 0) +
                                                dxf::line("OFF", 0, 0, 2, 0) + dxf::line("SEEN", 0, 0, 3, 0) +
                                                "0\nLINE\n8\n0\n67\n1\n10\n0\n20\n0\n11\n9\n21\n9\n" +
                                                "0\nTEXT\n8\n0\n10\n0\n20\n0\n1\nkitchen\n"));
  ASSERT_EQ(d.lines.size(), 1u);
  EXPECT_EQ(d.lines[0].to.x(), 3);
}

TEST(Dxf, ThatUnfoldsWithoutEndIsRefused) {
  // Ten of each block in the next: 10^9 lines from two screens of text.
  std::string blocks;
  std::string inner = dxf::line("0", 0, 0, 1, 1);
  for (int level = 0; level < 9; ++level) {
    std::string ten;
    for (int i = 0; i < 10; ++i)
      ten += level == 0 ? inner : "0\nINSERT\n8\n0\n2\nB" + std::to_string(level - 1) + "\n10\n0\n20\n0\n";
    blocks += dxf::block("B" + std::to_string(level), 0, 0, ten);
  }
  const auto insert = [](const std::string& name) {
    return "0\nINSERT\n8\n0\n2\n" + name + "\n10\n0\n20\n0\n";
  };
  const auto bomb = read_dxf(bytes(blocks + dxf::entities(insert("B8"))));
  ASSERT_FALSE(bomb.has_value());
  EXPECT_EQ(bomb.error().code, Errc::invalid_argument);
  const auto loop = dxf::block("ME", 0, 0, dxf::line("0", 0, 0, 1, 0) + insert("ME"));
  EXPECT_EQ(drawing(loop + dxf::entities(insert("ME"))).lines.size(), 16u) << "a block inside itself ends";
}

TEST(Dxf, CutAnywhereOrWithAnyByteBrokenIsReadOrRefused) {
  const auto whole = dxf::header(6) + dxf::block("D", 0, 0, dxf::line("0", 0, 0, 1, 0)) +
                     dxf::entities("0\nINSERT\n8\n0\n2\nD\n10\n0\n20\n0\n" + dxf::line("W", 0, 0, 5, 5));
  for (std::size_t n = 0; n < whole.size(); ++n) {
    (void)is_dxf(bytes(whole.substr(0, n)));
    const auto cut = read_dxf(bytes(whole.substr(0, n)));
    EXPECT_TRUE(cut.has_value() || !cut.error().message.empty());
    auto broken = whole;
    broken[n] = static_cast<char>(broken[n] ^ 0x55);
    (void)read_dxf(bytes(broken)).has_value();
  }
  const auto odd = read_dxf(bytes("0\nSECTION\n2\nENTITIES\n0\nLINE\nten\n0\n"));
  ASSERT_FALSE(odd.has_value());
  EXPECT_NE(odd.error().message.find("near its line 8"), std::string::npos) << odd.error().message;
  EXPECT_EQ(read_dxf(bytes("AutoCAD Binary DXF\r\n\x1a")).error().code, Errc::unsupported);
}

TEST(DrawnPlan, OfARoomWithTwoFacesAWallIsTracedWithin5Cm) {
  for (const double turn_deg : {0.0, 23.0}) {
    const auto made = draw_plan(drawing(dxf::header(4) + dxf::entities(dxf::room_mm(turn_deg))));
    ASSERT_TRUE(made.has_value()) << made.error().message;
    PlanTransform transform;
    transform.linear = made.value().drawing_m_from_pixel.leftCols<2>();
    transform.shift_m = made.value().drawing_m_from_pixel.col(2);
    EXPECT_NEAR(transform.scale_m_per_px(), 0.02, 1e-12);
    const auto trace = trace_plan(made.value().image, transform);
    ASSERT_TRUE(trace.has_value()) << trace.error().message;
    ASSERT_EQ(trace.value().outline_m.size(), 4u);
    const Eigen::Rotation2Dd turn(turn_deg * std::numbers::pi / 180);
    for (const Vector2d& corner : {Vector2d(0, 0), Vector2d(12, 0), Vector2d(12, 8), Vector2d(0, 8)}) {
      double nearest = 1e9;
      for (const auto& traced : trace.value().outline_m)
        nearest = std::min(nearest, (traced - turn * corner).norm());
      EXPECT_LT(nearest, 0.05);
    }
    double thickest = 0;
    for (const auto& wall : trace.value().walls) thickest = std::max(thickest, wall.thickness_m);
    EXPECT_NEAR(thickest, 0.30, 0.04);
  }
}

TEST(DrawnPlan, LeavesOutWhatWasForgottenFarAway) {
  const auto made = draw_plan(
      drawing(dxf::header(4) + dxf::entities(dxf::room_mm(0) + dxf::line("0", 9e8, 9e8, 9e8 + 1, 9e8))));
  ASSERT_TRUE(made.has_value());
  EXPECT_LT(made.value().image.width_px, 700) << "12 m at 2 cm a pixel";
}

// GDAL writes inches into every DXF; AutoCAD writes what its user never looked at.
TEST(DrawnPlan, OfMapCoordinatesIsInMetresWhateverUnitTheFileNames) {
  const auto inches =
      drawing(dxf::header(1) + dxf::entities(dxf::line("0", 550000, 5652600, 550014, 5652609)));
  const auto made = draw_plan(inches, Vector2d(550100, 5652000));
  ASSERT_TRUE(made.has_value());
  EXPECT_TRUE(made.value().is_at_site);
  EXPECT_EQ(made.value().image.width_px, 14 * 50 + 40);
  const auto elsewhere = draw_plan(inches, Vector2d(400000, 5652000));
  ASSERT_TRUE(elsewhere.has_value());
  EXPECT_FALSE(elsewhere.value().is_at_site);
  EXPECT_EQ(elsewhere.value().image.width_px, std::ceil(14 * 0.0254 * 50) + 40);
}

TEST(DrawnPlan, WithoutSizeIsRefused) {
  const auto point = draw_plan({{{Vector2d(1, 1), Vector2d(1, 1)}}, 1});
  ASSERT_FALSE(point.has_value());
  EXPECT_EQ(point.error().code, Errc::weak_geometry);
}

}  // namespace
}  // namespace anchord::floor_plan::drawing_test
