-- The server that has the database, of several that could: PostgreSQL alone fills it (docs/postgresql.md).
CREATE TABLE server_lease (
  one INTEGER PRIMARY KEY CHECK (one = 1),
  server TEXT NOT NULL,
  fence INTEGER NOT NULL, -- one more with every server that takes it
  lease_t_ns INTEGER NOT NULL, -- by the database's clock; 0: given back
  standby TEXT NOT NULL, -- who waits for it; empty: nobody yet
  standby_t_ns INTEGER NOT NULL -- when that was last heard of
) STRICT;
