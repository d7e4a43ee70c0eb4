-- Sites that a token is bound to. A column says that it is, so that one whose last site is gone sees nothing and
-- not everything; for the same reason the rows outlive their site.
ALTER TABLE token ADD COLUMN bound BIGINT NOT NULL DEFAULT 0 CHECK (bound IN (0, 1));

CREATE TABLE token_site (
  token_id BYTEA NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  site_id BYTEA NOT NULL CHECK (length(site_id) = 16),
  PRIMARY KEY (token_id, site_id)
);
