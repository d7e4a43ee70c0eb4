-- A deleted mission waits in a bin; whose rows the devices' are, and running time, outlive a restart.

-- Out of sight of everything but the bin's own list. Days in it count in running time, which no clock step moves.
CREATE TABLE mission_bin (
  mission_key BIGINT PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  deleted_t_ns BIGINT NOT NULL,
  deleted_ran_ns BIGINT NOT NULL,
  deleted_by TEXT COLLATE "C" NOT NULL,
  emptying BIGINT NOT NULL CHECK (emptying IN (0, 1)) -- 1: its rows are being removed
);

CREATE TABLE service_state (
  one BIGINT PRIMARY KEY CHECK (one = 1),
  running_ns BIGINT NOT NULL -- how long this database has been served, over all starts
);
INSERT INTO service_state (one, running_ns) VALUES (1, 0);

-- The last one has the rows of the devices; those before it get them back when it ends.
CREATE TABLE device_stream (
  position BIGINT PRIMARY KEY,
  mission_key BIGINT NOT NULL UNIQUE REFERENCES mission (mission_key) ON DELETE CASCADE
);
INSERT INTO device_stream (position, mission_key)
SELECT 1, mission_key FROM mission WHERE state = 1 AND frame = 0 ORDER BY mission_key DESC LIMIT 1;

-- created_t_ns of a kept answer is running time from now on: those of before count from its start.
UPDATE stored_answer SET created_t_ns = 0;
