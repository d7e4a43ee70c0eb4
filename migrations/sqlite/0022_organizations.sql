-- Organizations group sites: the customers of a firm's centre. A token may be bound to one instead of to sites; its
-- row outlives the organization, so that it sees nothing then and not everything (bound stays 1).
CREATE TABLE organization (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  description TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

ALTER TABLE site ADD COLUMN organization_id BLOB REFERENCES organization (id);
CREATE INDEX site_of_organization ON site (organization_id, id);

ALTER TABLE token ADD COLUMN organization_id BLOB CHECK (length(organization_id) = 16);
ALTER TABLE token ADD COLUMN requests_per_minute INTEGER CHECK (requests_per_minute > 0);

-- As site_quota, for all sites of an organization together.
CREATE TABLE organization_quota (
  organization_id BLOB PRIMARY KEY REFERENCES organization (id) ON DELETE CASCADE,
  max_missions INTEGER CHECK (max_missions >= 0),
  max_measurements INTEGER CHECK (max_measurements >= 0),
  max_anchors INTEGER CHECK (max_anchors >= 0),
  max_sites INTEGER CHECK (max_sites >= 0),
  requests_per_minute INTEGER CHECK (requests_per_minute > 0)
) STRICT, WITHOUT ROWID;
