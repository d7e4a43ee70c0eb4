-- The server that has the database, of several that could: PostgreSQL alone fills it (docs/postgresql.md).
CREATE TABLE server_lease (
  one BIGINT PRIMARY KEY CHECK (one = 1),
  server TEXT COLLATE "C" NOT NULL,
  fence BIGINT NOT NULL, -- one more with every server that takes it
  lease_t_ns BIGINT NOT NULL, -- by the database's clock; 0: given back
  standby TEXT COLLATE "C" NOT NULL, -- who waits for it; empty: nobody yet
  standby_t_ns BIGINT NOT NULL -- when that was last heard of
);

-- With the start of each write of a server: one that another has taken over from writes nothing more.
CREATE FUNCTION assert_server(wanted BIGINT) RETURNS BOOLEAN LANGUAGE plpgsql STABLE AS $$
BEGIN
  IF NOT EXISTS (SELECT 1 FROM server_lease WHERE fence = wanted) THEN
    RAISE EXCEPTION 'another server has taken over this database' USING ERRCODE = 'AN001';
  END IF;
  RETURN TRUE;
END $$;
