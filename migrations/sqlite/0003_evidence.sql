-- What a position rests on: gates, who overrode them and why, the kit's calibration, what the calibration was told.

ALTER TABLE site ADD COLUMN projected_epsg INTEGER;

ALTER TABLE calibration ADD COLUMN provenance_json TEXT NOT NULL DEFAULT '{}';

-- Large and seldom read: residuals and the course of the estimate, for the report.
CREATE TABLE calibration_evidence (
  calibration_key INTEGER PRIMARY KEY REFERENCES calibration (calibration_key) ON DELETE CASCADE,
  evidence_json TEXT NOT NULL
) STRICT;

CREATE TABLE estimate_gate (
  calibration_key INTEGER NOT NULL,
  network_id INTEGER NOT NULL,
  ordinal INTEGER NOT NULL,
  name TEXT NOT NULL,
  value REAL, -- NULL: could not be measured
  limit_value REAL,
  passed INTEGER NOT NULL CHECK (passed IN (0, 1)),
  why TEXT NOT NULL,
  PRIMARY KEY (calibration_key, network_id, ordinal),
  FOREIGN KEY (calibration_key, network_id) REFERENCES estimate (calibration_key, network_id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;

-- A person published this anchor although a gate failed.
CREATE TABLE revision_override (
  number INTEGER NOT NULL REFERENCES revision (number),
  network_id INTEGER NOT NULL,
  reason TEXT NOT NULL CHECK (reason <> ''),
  overridden_by TEXT NOT NULL,
  PRIMARY KEY (number, network_id)
) STRICT, WITHOUT ROWID;

-- Every profile a kit ever had; the highest version is in use.
CREATE TABLE kit_profile (
  kit TEXT NOT NULL CHECK (kit <> ''),
  version INTEGER NOT NULL,
  t_ns INTEGER NOT NULL,
  changed_by TEXT NOT NULL,
  source TEXT NOT NULL, -- "calibration <id>", "put"
  profile_json TEXT NOT NULL,
  PRIMARY KEY (kit, version)
) STRICT, WITHOUT ROWID;

CREATE TABLE local_frame (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL UNIQUE,
  site_id BLOB REFERENCES site (id),
  definition_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE INDEX local_frame_site ON local_frame (site_id);
