-- Which process runs a job, and how often one began it.
ALTER TABLE job ADD COLUMN worker TEXT COLLATE "C" NOT NULL DEFAULT '';
ALTER TABLE job ADD COLUMN attempts BIGINT NOT NULL DEFAULT 0;

-- Nanoseconds since 1970 at this instant: not now(), which is when the transaction began.
CREATE FUNCTION now_ns() RETURNS BIGINT LANGUAGE SQL VOLATILE AS
  'SELECT CAST(extract(epoch FROM clock_timestamp()) * 1000000000 AS BIGINT)';

-- Work of jobs that any process may do which has the database (docs/adr/0013). Times are of the database's clock.
CREATE TABLE work (
  job_id BYTEA PRIMARY KEY REFERENCES job (id) ON DELETE CASCADE,
  kind TEXT COLLATE "C" NOT NULL,
  version TEXT COLLATE "C" NOT NULL, -- of anchord: no other claims it
  message TEXT COLLATE "C" NOT NULL,
  state BIGINT NOT NULL CHECK (state BETWEEN 0 AND 2), -- open, claimed, done
  fence BIGINT NOT NULL, -- grows with every claim
  attempts BIGINT NOT NULL,
  max_attempts BIGINT NOT NULL,
  worker TEXT COLLATE "C" NOT NULL, -- of the newest claim
  open_t_ns BIGINT NOT NULL, -- since when it waits
  lease_t_ns BIGINT NOT NULL, -- until when the claim holds
  cancel_wanted BIGINT NOT NULL CHECK (cancel_wanted IN (0, 1)),
  fraction DOUBLE PRECISION NOT NULL,
  stage TEXT COLLATE "C" NOT NULL,
  detail TEXT COLLATE "C" NOT NULL,
  fault TEXT COLLATE "C" NOT NULL, -- why the attempt before this one ended
  result TEXT COLLATE "C", -- NULL: there is none
  error_code TEXT COLLATE "C" NOT NULL,
  error_text TEXT COLLATE "C" NOT NULL
);

-- Processes that claim work.
CREATE TABLE worker (
  name TEXT COLLATE "C" PRIMARY KEY,
  version TEXT COLLATE "C" NOT NULL,
  started_t_ns BIGINT NOT NULL,
  seen_t_ns BIGINT NOT NULL
);
