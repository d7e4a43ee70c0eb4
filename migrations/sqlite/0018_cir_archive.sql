-- Impulse responses that were moved out of the database, into one file a flight. A row of each stays: that it exists, and
-- the SHA-256 by which what is read back is known to be it.
CREATE TABLE cir_moved (
  range_id INTEGER PRIMARY KEY REFERENCES uwb_range (range_id) ON DELETE CASCADE,
  digest BLOB NOT NULL CHECK (length(digest) = 32)
) STRICT;

CREATE TABLE cir_archive (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  n_ranges INTEGER NOT NULL, -- that the flight had when it was last gone through; another number: there is more to move
  held INTEGER NOT NULL CHECK (held IN (0, 1)), -- brought back by somebody: not moved again by the rule
  file TEXT NOT NULL, -- empty: the flight has no impulse responses
  place TEXT NOT NULL, -- machine and folder in which the file was written
  sha256_hex TEXT NOT NULL,
  file_bytes INTEGER NOT NULL,
  n_cirs INTEGER NOT NULL, -- in the file
  n_moved INTEGER NOT NULL, -- of these, no longer in the database
  archived_t_ns INTEGER NOT NULL
) STRICT;
