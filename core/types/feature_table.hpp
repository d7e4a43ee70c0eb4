#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <variant>
#include <vector>

namespace anchord {

/// Features of one kind as GIS programs keep them: a geometry with heights and flat columns.
struct FeatureTable {
  enum class Geometry : std::uint8_t { point, line, polygon };
  enum class Type : std::uint8_t { text, integer, real, boolean, time };
  struct Column {
    std::string name;
    Type type{Type::text};
  };
  /// monostate: unknown. Times are RFC 3339 text.
  using Value = std::variant<std::monostate, std::string, std::int64_t, double, bool>;
  struct Row {
    /// Longitude and latitude in degrees, ellipsoidal height in metres; of a polygon its closed ring. Empty:
    /// no place on the globe.
    std::vector<Eigen::Vector3d> vertices;
    std::vector<Value> values;  ///< parallel to the columns
  };

  std::string name, title, description;
  Geometry geometry{Geometry::point};
  std::vector<Column> columns;
  std::vector<Row> rows;
  std::string qml;  ///< how QGIS draws it; empty: as it likes
};

}  // namespace anchord
