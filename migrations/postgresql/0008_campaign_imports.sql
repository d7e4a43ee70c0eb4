-- Imports of a campaign by the SHA-256 of their content, so that the same file sent again adds nothing. Rows
-- with a time have an identity of their own; rows without one have only their import.

CREATE TABLE campaign_import (
  campaign_key BIGINT NOT NULL REFERENCES campaign (campaign_key) ON DELETE CASCADE,
  digest TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (campaign_key, digest)
);
