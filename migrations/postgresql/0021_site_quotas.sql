-- What an administrator allows a site to store. A site without a row may store anything, as a limit that is NULL.
CREATE TABLE site_quota (
  site_id BYTEA PRIMARY KEY REFERENCES site (id) ON DELETE CASCADE,
  max_missions BIGINT CHECK (max_missions >= 0),
  max_measurements BIGINT CHECK (max_measurements >= 0), -- ranges and fixes
  max_anchors BIGINT CHECK (max_anchors >= 0)
);

CREATE INDEX mission_of_site ON mission (site_id);
CREATE INDEX anchor_of_site ON anchor (site_id);
