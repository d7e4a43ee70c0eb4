#include "server/storage/geopackage.hpp"

#include <SQLiteCpp/SQLiteCpp.h>
#include <sqlite3.h>

#include <Eigen/Geometry>

#include <algorithm>
#include <bit>
#include <cstring>
#include <memory>
#include <optional>

#include "core/base/check.hpp"

namespace anchord {
namespace {

constexpr int k_srs = 4979;

// Tables of clause 1 and annex C of the standard. definition_12_063 is the extension gpkg_crs_wkt (annex
// F.10): the older form of WKT knows no geographic system with heights.
constexpr const char* k_geopackage_schema = R"(
PRAGMA application_id = 0x47504B47;
PRAGMA user_version = 10300;
CREATE TABLE gpkg_spatial_ref_sys (srs_name TEXT NOT NULL, srs_id INTEGER NOT NULL PRIMARY KEY,
  organization TEXT NOT NULL, organization_coordsys_id INTEGER NOT NULL, definition TEXT NOT NULL,
  description TEXT, definition_12_063 TEXT NOT NULL DEFAULT 'undefined');
CREATE TABLE gpkg_contents (table_name TEXT NOT NULL PRIMARY KEY, data_type TEXT NOT NULL, identifier TEXT UNIQUE,
  description TEXT DEFAULT '', last_change DATETIME NOT NULL, min_x DOUBLE, min_y DOUBLE, max_x DOUBLE,
  max_y DOUBLE, srs_id INTEGER REFERENCES gpkg_spatial_ref_sys(srs_id));
CREATE TABLE gpkg_geometry_columns (table_name TEXT NOT NULL PRIMARY KEY REFERENCES gpkg_contents(table_name),
  column_name TEXT NOT NULL, geometry_type_name TEXT NOT NULL,
  srs_id INTEGER NOT NULL REFERENCES gpkg_spatial_ref_sys(srs_id), z TINYINT NOT NULL, m TINYINT NOT NULL);
CREATE TABLE gpkg_extensions (table_name TEXT, column_name TEXT, extension_name TEXT NOT NULL,
  definition TEXT NOT NULL, scope TEXT NOT NULL, UNIQUE (table_name, column_name, extension_name));
CREATE TABLE layer_styles (id INTEGER PRIMARY KEY, f_table_catalog TEXT, f_table_schema TEXT, f_table_name TEXT,
  f_geometry_column TEXT, styleName TEXT, styleQML TEXT, styleSLD TEXT, useAsDefault BOOLEAN, description TEXT,
  owner TEXT, ui TEXT, update_time DATETIME);
INSERT INTO gpkg_spatial_ref_sys VALUES
  ('Undefined Cartesian', -1, 'NONE', -1, 'undefined', NULL, 'undefined'),
  ('Undefined geographic', 0, 'NONE', 0, 'undefined', NULL, 'undefined'),
  ('WGS 84', 4326, 'EPSG', 4326,
   'GEOGCS["WGS 84",DATUM["WGS_1984",SPHEROID["WGS 84",6378137,298.257223563,AUTHORITY["EPSG","7030"]],AUTHORITY["EPSG","6326"]],PRIMEM["Greenwich",0,AUTHORITY["EPSG","8901"]],UNIT["degree",0.0174532925199433,AUTHORITY["EPSG","9122"]],AXIS["Latitude",NORTH],AXIS["Longitude",EAST],AUTHORITY["EPSG","4326"]]',
   NULL, 'undefined'),
  ('WGS 84 with ellipsoidal height', 4979, 'EPSG', 4979, 'undefined', 'longitude, latitude, ellipsoidal height',
   'GEODCRS["WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563,LENGTHUNIT["metre",1]]],CS[ellipsoidal,3],AXIS["latitude",north,ORDER[1],ANGLEUNIT["degree",0.0174532925199433]],AXIS["longitude",east,ORDER[2],ANGLEUNIT["degree",0.0174532925199433]],AXIS["ellipsoidal height",up,ORDER[3],LENGTHUNIT["metre",1]],ID["EPSG",4979]]');
INSERT INTO gpkg_extensions VALUES
  ('gpkg_spatial_ref_sys', 'definition_12_063', 'gpkg_crs_wkt', 'http://www.geopackage.org/spec120/#extension_crs_wkt', 'read-write');
)";
constexpr const char* k_add_contents =
    "INSERT INTO gpkg_contents VALUES (?, 'features', ?, ?, ?, ?, ?, ?, ?, 4979)";
constexpr const char* k_add_geometry = "INSERT INTO gpkg_geometry_columns VALUES (?, 'geom', ?, 4979, 1, 0)";
constexpr const char* k_add_style =
    "INSERT INTO layer_styles VALUES (NULL, '', '', ?, 'geom', ?, ?, '', 1, '', '', NULL, ?)";

struct Kind {
  const char* name;
  std::uint32_t wkb;  ///< ISO 13249-3 code with z
};
Kind kind_of(FeatureTable::Geometry geometry) {
  switch (geometry) {
    case FeatureTable::Geometry::point:
      return {"POINT", 1001};
    case FeatureTable::Geometry::line:
      return {"LINESTRING", 1002};
    case FeatureTable::Geometry::polygon:
      return {"POLYGON", 1003};
  }
  return {"GEOMETRY", 0};
}

const char* type_of(FeatureTable::Type type) {
  switch (type) {
    case FeatureTable::Type::text:
      return "TEXT";
    case FeatureTable::Type::integer:
      return "INTEGER";
    case FeatureTable::Type::real:
      return "REAL";
    case FeatureTable::Type::boolean:
      return "BOOLEAN";
    case FeatureTable::Type::time:
      return "DATETIME";
  }
  return "TEXT";
}

template <class T>
void append(std::string& out, T value) {
  static_assert(std::endian::native == std::endian::little, "the header below says little endian");
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  out.append(bytes, sizeof value);
}

/// GeoPackageBinary (clause 2.1.3): header without envelope, then WKB.
std::string blob_of(const FeatureTable& table, const std::vector<Eigen::Vector3d>& vertices) {
  std::string out{'G', 'P', '\0', '\1'};  // version 1, little endian, no envelope
  append(out, std::int32_t{k_srs});
  out += '\1';
  append(out, kind_of(table.geometry).wkb);
  if (table.geometry == FeatureTable::Geometry::polygon) append(out, std::uint32_t{1});
  if (table.geometry != FeatureTable::Geometry::point)
    append(out, static_cast<std::uint32_t>(vertices.size()));
  for (const auto& v : vertices) {
    for (int i = 0; i < 3; ++i) append(out, v[i]);
  }
  return out;
}

/// Names are our own, but SQL is no place for trust.
std::string quoted(const std::string& name) {
  std::string out = "\"";
  for (const char c : name) out += c == '"' ? "\"\"" : std::string(1, c);
  return out + '"';
}

/// DATETIME has milliseconds (clause 1.1.1.1.1.1): "2026-05-04T10:11:12.345Z".
std::string milliseconds(const std::string& rfc3339) {
  const auto dot = rfc3339.find('.');
  return dot == std::string::npos ? rfc3339 : rfc3339.substr(0, dot + 4) + 'Z';
}

void bind(SQLite::Statement& statement, int at, FeatureTable::Type type, const FeatureTable::Value& value) {
  if (const auto* text = std::get_if<std::string>(&value))
    return statement.bind(at, type == FeatureTable::Type::time ? milliseconds(*text) : *text);
  if (const auto* whole = std::get_if<std::int64_t>(&value)) return statement.bind(at, *whole);
  if (const auto* real = std::get_if<double>(&value)) return statement.bind(at, *real);
  if (const auto* flag = std::get_if<bool>(&value)) return statement.bind(at, *flag ? 1 : 0);
  statement.bind(at);
}

/// Puts rows into a table that it creates.
class RowWriter {
 public:
  RowWriter(SQLite::Database& db, const FeatureTable& table) : table_(head_of(table)) {
    std::string create = "CREATE TABLE " + quoted(table.name) +
                         " (fid INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, geom " +
                         kind_of(table.geometry).name;
    std::string insert = "INSERT INTO " + quoted(table.name) + " VALUES (NULL, ?";
    for (const auto& column : table.columns) {
      create += ", " + quoted(column.name) + ' ' + type_of(column.type);
      insert += ", ?";
    }
    db.exec(create + ')');
    statement_.emplace(db, insert + ')');
  }
  void add(const FeatureTable::Row& row) {
    ANCHORD_CHECK(row.values.size() == table_.columns.size(),
                  "a row of " << table_.name << " has " << row.values.size() << " values for "
                              << table_.columns.size() << " columns");
    for (const auto& v : row.vertices) box_.extend(v);
    if (row.vertices.empty()) {
      statement_->bind(1);
    } else {
      const auto blob = blob_of(table_, row.vertices);
      statement_->bind(1, blob.data(), static_cast<int>(blob.size()));
    }
    for (std::size_t i = 0; i < row.values.size(); ++i)
      bind(*statement_, static_cast<int>(i) + 2, table_.columns[i].type, row.values[i]);
    statement_->exec();
    statement_->reset();
  }
  const Eigen::AlignedBox3d& box() const { return box_; }

 private:
  static FeatureTable head_of(const FeatureTable& table) {
    FeatureTable out;
    out.name = table.name;
    out.geometry = table.geometry;
    out.columns = table.columns;
    return out;
  }
  FeatureTable table_;
  std::optional<SQLite::Statement> statement_;
  Eigen::AlignedBox3d box_;
};

/// What readers look for first; once the rows are there, for it has their bounds.
void describe(SQLite::Database& db, const FeatureTable& table, const Eigen::AlignedBox3d& box,
              const std::string& now) {
  SQLite::Statement contents(db, k_add_contents);
  contents.bind(1, table.name);
  contents.bind(2, table.title);
  contents.bind(3, table.description);
  contents.bind(4, now);
  if (!box.isEmpty()) {
    contents.bind(5, box.min().x());
    contents.bind(6, box.min().y());
    contents.bind(7, box.max().x());
    contents.bind(8, box.max().y());
  }
  contents.exec();
  SQLite::Statement geometry(db, k_add_geometry);
  geometry.bind(1, table.name);
  geometry.bind(2, kind_of(table.geometry).name);
  geometry.exec();
  if (!table.qml.empty()) {
    SQLite::Statement style(db, k_add_style);
    style.bind(1, table.name);
    style.bind(2, table.title);
    style.bind(3, table.qml);
    style.bind(4, now);
    style.exec();
  }
}

void add_table(SQLite::Database& db, const FeatureTable& table, const std::string& now) {
  RowWriter writer(db, table);
  for (const auto& row : table.rows) writer.add(row);
  describe(db, table, writer.box(), now);
}

Error cannot_make(const SQLite::Exception& error) {
  return make_error(error.getErrorCode() == SQLITE_FULL ? Errc::storage_full : Errc::storage_unavailable,
                    std::string("a GeoPackage could not be created: ") + error.what());
}

class GeopackageFile final : public FeatureFile {
 public:
  GeopackageFile(const std::filesystem::path& path, const FeatureTable& head, UtcTime now)
      : db_(path.string(), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE),
        now_(milliseconds(to_rfc3339(now))) {
    db_.exec("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA cache_size = -8000");
    db_.exec(k_geopackage_schema);
    db_.exec("BEGIN");
    writer_.emplace(db_, head);
    for (const auto& row : head.rows) writer_->add(row);
    head_ = head;
    head_.rows.clear();
  }
  Result<void> add(std::span<const FeatureTable::Row> rows) override {
    return tried([&] {
      for (const auto& row : rows) writer_->add(row);
    });
  }
  Result<void> finish() override {
    return tried([&] {
      describe(db_, head_, writer_->box(), now_);
      db_.exec("COMMIT");
    });
  }

 private:
  template <class Work>
  Result<void> tried(const Work& work) {
    try {
      work();
    } catch (const SQLite::Exception& error) {
      return cannot_make(error);
    }
    return boost::outcome_v2::success();
  }
  SQLite::Database db_;
  const std::string now_;
  FeatureTable head_;
  std::optional<RowWriter> writer_;
};

}  // namespace

Result<std::string> geopackage(std::span<const FeatureTable> tables, UtcTime now) {
  try {
    SQLite::Database db(":memory:", SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    db.exec(k_geopackage_schema);
    db.exec("BEGIN");
    for (const auto& table : tables) add_table(db, table, milliseconds(to_rfc3339(now)));
    db.exec("COMMIT");
    sqlite3_int64 size = 0;
    const std::unique_ptr<unsigned char, decltype(&sqlite3_free)> bytes(
        sqlite3_serialize(db.getHandle(), "main", &size, 0), &sqlite3_free);
    if (!bytes) return Error{Errc::storage_unavailable, "out of memory while a GeoPackage was made"};
    std::string out(static_cast<std::size_t>(size), '\0');
    std::memcpy(out.data(), bytes.get(), out.size());
    return out;
  } catch (const SQLite::Exception& error) {
    return cannot_make(error);
  }
}

Result<std::unique_ptr<FeatureFile>> make_geopackage_file(const std::filesystem::path& path,
                                                          const FeatureTable& head, UtcTime now) {
  try {
    return std::unique_ptr<FeatureFile>(std::make_unique<GeopackageFile>(path, head, now));
  } catch (const SQLite::Exception& error) {
    return cannot_make(error);
  }
}

}  // namespace anchord
