-- Plans of flights, and the state of the procedure that a mission is flown with.
CREATE TABLE plan (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  site_id BLOB REFERENCES site (id),
  document_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  changed_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

CREATE TABLE mission_procedure (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  state_json TEXT NOT NULL,
  changed_t_ns INTEGER NOT NULL
) STRICT;
