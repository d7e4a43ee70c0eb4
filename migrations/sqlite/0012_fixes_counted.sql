-- Lists and filters whose cost does not grow with the measurements that they do not show.

-- Kept by the appends, as the ranges of a radio are in device_seen: a list of missions counts nothing.
CREATE TABLE mission_fixes (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  n_fixes INTEGER NOT NULL
) STRICT;
INSERT INTO mission_fixes (mission_key, n_fixes)
SELECT mission_key, count(*) FROM fix GROUP BY mission_key;

-- Ranges after a position of some class are found from the positions of that class.
CREATE INDEX fix_class_time ON fix (mission_key, fix_class, t_ns);
