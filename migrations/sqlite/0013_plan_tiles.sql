-- The plan of a floor in square pictures, level by level.

-- A pyramid whose floor is gone, or has another, belongs to nobody and is then deleted in parts: thousands of tiles in one
-- transaction would keep measurements waiting.
CREATE TABLE plan_tiles (
  tiles_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  floor_id BLOB REFERENCES building_floor (id) ON DELETE SET NULL,
  named INTEGER NOT NULL,
  n_levels INTEGER NOT NULL,
  m_per_px REAL NOT NULL,
  width_px INTEGER NOT NULL,
  height_px INTEGER NOT NULL,
  west_m REAL NOT NULL,
  north_m REAL NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL
) STRICT;

CREATE INDEX plan_tiles_of_floor ON plan_tiles (floor_id);

CREATE TABLE plan_tile (
  tile_key INTEGER PRIMARY KEY,
  tiles_id BLOB NOT NULL REFERENCES plan_tiles (id),
  level INTEGER NOT NULL,
  tile_column INTEGER NOT NULL,
  tile_row INTEGER NOT NULL,
  content BLOB NOT NULL,
  UNIQUE (tiles_id, level, tile_column, tile_row)
) STRICT;
