-- Plans of flights, and the state of the procedure that a mission is flown with.
CREATE TABLE plan (
  id BYTEA PRIMARY KEY CHECK (length(id) = 16),
  name TEXT COLLATE "C" NOT NULL,
  site_id BYTEA REFERENCES site (id),
  document_json TEXT COLLATE "C" NOT NULL,
  created_t_ns BIGINT NOT NULL,
  changed_t_ns BIGINT NOT NULL,
  version BIGINT NOT NULL
);

CREATE TABLE mission_procedure (
  mission_key BIGINT PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  state_json TEXT COLLATE "C" NOT NULL,
  changed_t_ns BIGINT NOT NULL
);
