-- What a person, and this server, say of what came from outside: measurements taken out of use, and back, as rows of
-- their own, for measurements are append-only; and the signature of models.

CREATE TABLE exclusion (
  exclusion_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  kind INTEGER NOT NULL CHECK (kind IN (0, 1)), -- 0 ranges, 1 fixes
  since_t_ns INTEGER,
  until_t_ns INTEGER, -- not included
  anchor INTEGER,
  tag INTEGER,
  n_rows INTEGER NOT NULL,
  reason TEXT NOT NULL CHECK (reason <> ''),
  created_t_ns INTEGER NOT NULL,
  created_by TEXT NOT NULL
) STRICT;
CREATE INDEX exclusion_mission ON exclusion (mission_key);

-- Rows named one by one, by what they are: the same wherever the flight is copied to.
CREATE TABLE exclusion_row (
  exclusion_key INTEGER NOT NULL REFERENCES exclusion (exclusion_key) ON DELETE CASCADE,
  t_ns INTEGER NOT NULL,
  tag INTEGER NOT NULL,
  anchor INTEGER NOT NULL,
  antenna INTEGER NOT NULL,
  PRIMARY KEY (exclusion_key, t_ns, tag, anchor, antenna)
) STRICT, WITHOUT ROWID;

CREATE TABLE exclusion_taken_back (
  exclusion_key INTEGER PRIMARY KEY REFERENCES exclusion (exclusion_key) ON DELETE CASCADE,
  reason TEXT NOT NULL,
  t_ns INTEGER NOT NULL,
  taken_back_by TEXT NOT NULL
) STRICT;

CREATE TRIGGER exclusion_keeps_what_it_says BEFORE UPDATE ON exclusion
BEGIN
  SELECT RAISE (ABORT, 'exclusions are append-only');
END;

-- What this server says of a model's artifact: made here, or vouched for by a promotion. Empty: nothing.
ALTER TABLE model ADD COLUMN signature TEXT NOT NULL DEFAULT '';
