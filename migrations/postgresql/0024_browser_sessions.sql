-- Browsers that are signed in, so that they stay so when the server starts again or another one takes over.
CREATE TABLE browser_session (
  cookie_sha256_hex TEXT COLLATE "C" PRIMARY KEY,
  token_id BYTEA NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  until_t_ns BIGINT NOT NULL
);
