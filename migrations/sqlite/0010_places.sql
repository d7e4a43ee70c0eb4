-- Buildings, their floors, and the plans of floors. Pictures are kept in parts, so that no transaction writes more than
-- one of them.

CREATE TABLE building (
  building_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  site_id BLOB NOT NULL REFERENCES site (id),
  name TEXT NOT NULL,
  height_m REAL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;

CREATE INDEX building_of_site ON building (site_id);

CREATE TABLE building_floor (
  floor_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  building_id BLOB NOT NULL REFERENCES building (id),
  name TEXT NOT NULL,
  level REAL NOT NULL,
  base_height_m REAL,
  georeference TEXT NOT NULL,
  proposal TEXT NOT NULL,
  structure TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;

CREATE INDEX floor_of_building ON building_floor (building_id);

CREATE TABLE plan_image (
  image_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  floor_id BLOB NOT NULL REFERENCES building_floor (id) ON DELETE CASCADE,
  kind INTEGER NOT NULL,
  named INTEGER NOT NULL,
  media_type TEXT NOT NULL,
  width_px INTEGER NOT NULL,
  height_px INTEGER NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL
) STRICT;

CREATE INDEX plan_image_of_floor ON plan_image (floor_id);

CREATE TABLE plan_image_part (
  image_id BLOB NOT NULL REFERENCES plan_image (id) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  content BLOB NOT NULL,
  PRIMARY KEY (image_id, ordinal)
) STRICT;
