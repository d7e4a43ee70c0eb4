-- Impulse responses that were moved out of the database, into one file a flight. A row of each stays: that it exists, and
-- the SHA-256 by which what is read back is known to be it.
CREATE TABLE cir_moved (
  range_id BIGINT PRIMARY KEY REFERENCES uwb_range (range_id) ON DELETE CASCADE,
  digest BYTEA NOT NULL CHECK (length(digest) = 32)
);

CREATE TABLE cir_archive (
  mission_key BIGINT PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  n_ranges BIGINT NOT NULL, -- that the flight had when it was last gone through; another number: there is more to move
  held BIGINT NOT NULL CHECK (held IN (0, 1)), -- brought back by somebody: not moved again by the rule
  file TEXT COLLATE "C" NOT NULL, -- empty: the flight has no impulse responses
  place TEXT COLLATE "C" NOT NULL, -- machine and folder in which the file was written
  sha256_hex TEXT COLLATE "C" NOT NULL,
  file_bytes BIGINT NOT NULL,
  n_cirs BIGINT NOT NULL, -- in the file
  n_moved BIGINT NOT NULL, -- of these, no longer in the database
  archived_t_ns BIGINT NOT NULL
);
