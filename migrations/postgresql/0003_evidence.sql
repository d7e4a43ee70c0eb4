-- What a position rests on: gates, who overrode them and why, the kit's calibration, what the calibration was told.

ALTER TABLE site ADD COLUMN projected_epsg BIGINT;

ALTER TABLE calibration ADD COLUMN provenance_json TEXT COLLATE "C" NOT NULL DEFAULT '{}';

-- Large and seldom read: residuals and the course of the estimate, for the report.
CREATE TABLE calibration_evidence (
  calibration_key BIGINT PRIMARY KEY REFERENCES calibration (calibration_key) ON DELETE CASCADE,
  evidence_json TEXT COLLATE "C" NOT NULL
);

CREATE TABLE estimate_gate (
  calibration_key BIGINT NOT NULL,
  network_id BIGINT NOT NULL,
  ordinal BIGINT NOT NULL,
  name TEXT COLLATE "C" NOT NULL,
  value DOUBLE PRECISION, -- NULL: could not be measured
  limit_value DOUBLE PRECISION,
  passed BIGINT NOT NULL CHECK (passed IN (0, 1)),
  why TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (calibration_key, network_id, ordinal),
  FOREIGN KEY (calibration_key, network_id) REFERENCES estimate (calibration_key, network_id) ON DELETE CASCADE
);

-- A person published this anchor although a gate failed.
CREATE TABLE revision_override (
  number BIGINT NOT NULL REFERENCES revision (number),
  network_id BIGINT NOT NULL,
  reason TEXT COLLATE "C" NOT NULL CHECK (reason <> ''),
  overridden_by TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (number, network_id)
);

-- Every profile a kit ever had; the highest version is in use.
CREATE TABLE kit_profile (
  kit TEXT COLLATE "C" NOT NULL CHECK (kit <> ''),
  version BIGINT NOT NULL,
  t_ns BIGINT NOT NULL,
  changed_by TEXT COLLATE "C" NOT NULL,
  source TEXT COLLATE "C" NOT NULL, -- "calibration <id>", "put"
  profile_json TEXT COLLATE "C" NOT NULL,
  PRIMARY KEY (kit, version)
);

CREATE TABLE local_frame (
  id BYTEA PRIMARY KEY CHECK (length(id) = 16),
  name TEXT COLLATE "C" NOT NULL UNIQUE,
  site_id BYTEA REFERENCES site (id),
  definition_json TEXT COLLATE "C" NOT NULL,
  created_t_ns BIGINT NOT NULL,
  version BIGINT NOT NULL
);
CREATE INDEX local_frame_site ON local_frame (site_id);
