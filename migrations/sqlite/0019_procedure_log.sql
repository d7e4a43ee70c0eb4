-- What the procedure of a flight showed: each transition, each decision with its candidates, each turn and height search. A
-- replay shows the same again.
CREATE TABLE procedure_log (
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  number INTEGER NOT NULL, -- from 1, in the order in which they came
  t_ns INTEGER NOT NULL,
  topic TEXT NOT NULL,
  message_json TEXT NOT NULL,
  PRIMARY KEY (mission_key, number)
) STRICT;
