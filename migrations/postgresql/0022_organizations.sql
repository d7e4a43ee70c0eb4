-- Organizations group sites: the customers of a firm's centre. A token may be bound to one instead of to sites; its
-- row outlives the organization, so that it sees nothing then and not everything (bound stays 1).
CREATE TABLE organization (
  id BYTEA PRIMARY KEY CHECK (length(id) = 16),
  name TEXT COLLATE "C" NOT NULL,
  description TEXT COLLATE "C" NOT NULL,
  created_t_ns BIGINT NOT NULL,
  version BIGINT NOT NULL
);

ALTER TABLE site ADD COLUMN organization_id BYTEA REFERENCES organization (id);
CREATE INDEX site_of_organization ON site (organization_id, id);

ALTER TABLE token ADD COLUMN organization_id BYTEA CHECK (length(organization_id) = 16);
ALTER TABLE token ADD COLUMN requests_per_minute BIGINT CHECK (requests_per_minute > 0);

-- As site_quota, for all sites of an organization together.
CREATE TABLE organization_quota (
  organization_id BYTEA PRIMARY KEY REFERENCES organization (id) ON DELETE CASCADE,
  max_missions BIGINT CHECK (max_missions >= 0),
  max_measurements BIGINT CHECK (max_measurements >= 0),
  max_anchors BIGINT CHECK (max_anchors >= 0),
  max_sites BIGINT CHECK (max_sites >= 0),
  requests_per_minute BIGINT CHECK (requests_per_minute > 0)
);
