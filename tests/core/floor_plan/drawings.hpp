#pragma once

#include <cmath>
#include <numbers>
#include <string>

/// DXF files made by hand, group by group.
namespace anchord::floor_plan::dxf {

inline std::string section(const std::string& name, const std::string& inside) {
  return "0\nSECTION\n2\n" + name + "\n" + inside + "0\nENDSEC\n";
}
/// unit  group 70 of $INSUNITS: 4 millimetres, 6 metres
inline std::string header(int unit) {
  return section("HEADER", "9\n$INSUNITS\n70\n" + std::to_string(unit) + "\n");
}
inline std::string entities(const std::string& inside) { return section("ENTITIES", inside) + "0\nEOF\n"; }
inline std::string line(const std::string& layer, double x0, double y0, double x1, double y1) {
  const auto n = [](double v) { return std::to_string(v) + "\n"; };
  return "0\nLINE\n8\n" + layer + "\n10\n" + n(x0) + "20\n" + n(y0) + "30\n0\n11\n" + n(x1) + "21\n" + n(y1) +
         "31\n0\n";
}
inline std::string block(const std::string& name, double x, double y, const std::string& inside) {
  return section("BLOCKS", "0\nBLOCK\n8\n0\n2\n" + name + "\n70\n0\n10\n" + std::to_string(x) + "\n20\n" +
                               std::to_string(y) + "\n" + inside + "0\nENDBLK\n");
}

/// Walls of 30 cm round 12 m x 8 m by both their faces, a partition of 10 cm, a table and a sheet border, in
/// millimetres, the lower left corner at (`x`, `y`), turned round it.
inline std::string room_mm(double turn_deg, double x = 0, double y = 0) {
  const double c = std::cos(turn_deg * std::numbers::pi / 180),
               s = std::sin(turn_deg * std::numbers::pi / 180);
  std::string out;
  const auto box = [&](const char* layer, double x0, double y0, double x1, double y1) {
    const double corner[5][2]{{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}, {x0, y0}};
    for (int i = 0; i < 4; ++i) {
      const auto *a = corner[i], *b = corner[i + 1];
      out += line(layer, x + c * a[0] - s * a[1], y + s * a[0] + c * a[1], x + c * b[0] - s * b[1],
                  y + s * b[0] + c * b[1]);
    }
  };
  box("A-WALL", 0, 0, 12000, 8000);
  box("A-WALL", 300, 300, 11700, 7700);
  box("A-WALL-PRTN", 5000, 300, 5100, 5000);
  box("A-FURN", 8000, 2000, 9600, 2800);
  return out;
}

}  // namespace anchord::floor_plan::dxf
