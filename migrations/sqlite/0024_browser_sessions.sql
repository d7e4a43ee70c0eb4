-- Browsers that are signed in, so that they stay so when the server starts again or another one takes over.
CREATE TABLE browser_session (
  cookie_sha256_hex TEXT PRIMARY KEY,
  token_id BLOB NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  until_t_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
