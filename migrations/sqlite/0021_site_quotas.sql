-- What an administrator allows a site to store. A site without a row may store anything, as a limit that is NULL.
CREATE TABLE site_quota (
  site_id BLOB PRIMARY KEY REFERENCES site (id) ON DELETE CASCADE,
  max_missions INTEGER CHECK (max_missions >= 0),
  max_measurements INTEGER CHECK (max_measurements >= 0), -- ranges and fixes
  max_anchors INTEGER CHECK (max_anchors >= 0)
) STRICT, WITHOUT ROWID;

CREATE INDEX mission_of_site ON mission (site_id);
CREATE INDEX anchor_of_site ON anchor (site_id);
