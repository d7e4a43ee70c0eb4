-- Which process runs a job, and how often one began it.
ALTER TABLE job ADD COLUMN worker TEXT NOT NULL DEFAULT '';
ALTER TABLE job ADD COLUMN attempts INTEGER NOT NULL DEFAULT 0;

-- Work of jobs that any process may do which has the database (docs/adr/0013). Times are of the database's clock.
CREATE TABLE work (
  job_id BLOB PRIMARY KEY REFERENCES job (id) ON DELETE CASCADE,
  kind TEXT NOT NULL,
  version TEXT NOT NULL, -- of anchord: no other claims it
  message TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2), -- open, claimed, done
  fence INTEGER NOT NULL, -- grows with every claim
  attempts INTEGER NOT NULL,
  max_attempts INTEGER NOT NULL,
  worker TEXT NOT NULL, -- of the newest claim
  open_t_ns INTEGER NOT NULL, -- since when it waits
  lease_t_ns INTEGER NOT NULL, -- until when the claim holds
  cancel_wanted INTEGER NOT NULL CHECK (cancel_wanted IN (0, 1)),
  fraction REAL NOT NULL,
  stage TEXT NOT NULL,
  detail TEXT NOT NULL,
  fault TEXT NOT NULL, -- why the attempt before this one ended
  result TEXT, -- NULL: there is none
  error_code TEXT NOT NULL,
  error_text TEXT NOT NULL
) STRICT, WITHOUT ROWID;

-- Processes that claim work.
CREATE TABLE worker (
  name TEXT NOT NULL PRIMARY KEY,
  version TEXT NOT NULL,
  started_t_ns INTEGER NOT NULL,
  seen_t_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
