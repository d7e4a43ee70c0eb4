-- Events of a flight, which a restart of the server leaves as they are: a replay shows procedure and alarms of each moment.
CREATE TABLE mission_event (
  event_key INTEGER PRIMARY KEY, -- in the order in which they came
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  t_ns INTEGER NOT NULL,
  level INTEGER NOT NULL CHECK (level IN (0, 1, 2)), -- 0 info, 1 warning, 2 critical
  code TEXT NOT NULL,
  text TEXT NOT NULL,
  lat_deg REAL, -- where the aircraft is sent by it: all three or none
  lon_deg REAL,
  height_above_ground_m REAL
) STRICT;
CREATE INDEX mission_event_mission ON mission_event (mission_key, event_key);
