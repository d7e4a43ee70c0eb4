-- Learning: campaigns with ground truth, frozen data sets, training runs, models and their promotions.

CREATE TABLE campaign (
  campaign_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  name TEXT NOT NULL UNIQUE,
  radio TEXT NOT NULL,
  note TEXT NOT NULL,
  truth_sigma_m REAL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;

-- Ground truth of one placement of the devices.
CREATE TABLE campaign_setting (
  setting_key INTEGER PRIMARY KEY,
  campaign_key INTEGER NOT NULL REFERENCES campaign (campaign_key) ON DELETE CASCADE,
  name TEXT NOT NULL,
  environment TEXT NOT NULL,
  distance_m REAL,
  los INTEGER CHECK (los IN (0, 1)),
  heading_deg REAL,
  height_difference_m REAL,
  material TEXT NOT NULL,
  thickness_m REAL,
  truth_sigma_m REAL,
  UNIQUE (campaign_key, name)
) STRICT;

CREATE TABLE campaign_sample (
  sample_id INTEGER PRIMARY KEY,
  setting_key INTEGER NOT NULL REFERENCES campaign_setting (setting_key) ON DELETE CASCADE,
  t_ns INTEGER,
  seq INTEGER,
  range_m REAL NOT NULL,
  rx_dbm REAL,
  fp_dbm REAL,
  fp_amp1 REAL,
  fp_amp2 REAL,
  fp_amp3 REAL,
  cir_power REAL,
  preamble_count REAL,
  std_noise REAL,
  max_noise REAL,
  fp_index REAL
) STRICT;
CREATE INDEX campaign_sample_setting ON campaign_sample (setting_key, sample_id);
CREATE UNIQUE INDEX campaign_sample_identity ON campaign_sample (setting_key, t_ns, ifnull(seq, -1)) WHERE t_ns IS NOT NULL;

CREATE TABLE campaign_cir (
  sample_id INTEGER PRIMARY KEY REFERENCES campaign_sample (sample_id) ON DELETE CASCADE,
  dt_ps REAL NOT NULL,
  first_path_idx REAL,
  preamble_count REAL,
  re_im BLOB NOT NULL -- int16 little endian: re, im, re, im, ...
) STRICT;

-- A frozen query; the rows stand in its table of text, and the digest covers them.
CREATE TABLE dataset (
  dataset_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  name TEXT NOT NULL UNIQUE,
  query_json TEXT NOT NULL,
  report_json TEXT NOT NULL,
  digest TEXT NOT NULL,
  n_train INTEGER NOT NULL,
  n_test INTEGER NOT NULL,
  created_t_ns INTEGER NOT NULL,
  created_by TEXT NOT NULL
) STRICT;

CREATE TABLE dataset_content (
  dataset_key INTEGER PRIMARY KEY REFERENCES dataset (dataset_key) ON DELETE CASCADE,
  csv TEXT NOT NULL
) STRICT;

CREATE TABLE training_run (
  run_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  dataset_key INTEGER NOT NULL REFERENCES dataset (dataset_key),
  task TEXT NOT NULL,
  request_json TEXT NOT NULL,
  summary_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  created_by TEXT NOT NULL
) STRICT;
CREATE INDEX training_run_dataset ON training_run (dataset_key);

-- What a finished run found, in parts that are read one by one.
CREATE TABLE training_part (
  run_key INTEGER NOT NULL REFERENCES training_run (run_key) ON DELETE CASCADE,
  name TEXT NOT NULL,
  json TEXT NOT NULL,
  PRIMARY KEY (run_key, name)
) STRICT, WITHOUT ROWID;

CREATE TABLE model (
  model_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  run_key INTEGER REFERENCES training_run (run_key) ON DELETE SET NULL,
  task TEXT NOT NULL,
  method TEXT NOT NULL,
  sha256_hex TEXT NOT NULL,
  manifest_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  created_by TEXT NOT NULL
) STRICT;
CREATE INDEX model_run ON model (run_key);

CREATE TABLE model_artifact (
  model_key INTEGER PRIMARY KEY REFERENCES model (model_key) ON DELETE CASCADE,
  json TEXT NOT NULL
) STRICT;

-- The newest of a task says which model is active; without a model none is.
CREATE TABLE model_promotion (
  number INTEGER PRIMARY KEY,
  task TEXT NOT NULL,
  model_key INTEGER REFERENCES model (model_key),
  t_ns INTEGER NOT NULL,
  promoted_by TEXT NOT NULL,
  reason TEXT NOT NULL,
  is_rollback INTEGER NOT NULL CHECK (is_rollback IN (0, 1))
) STRICT;
CREATE INDEX model_promotion_task ON model_promotion (task, number);
CREATE INDEX model_promotion_model ON model_promotion (model_key);
