PRAGMA application_id = 0x414e4348;
PRAGMA user_version = 24;
PRAGMA foreign_keys=OFF;
BEGIN TRANSACTION;
CREATE TABLE schema_migration (
  number INTEGER PRIMARY KEY,
  name TEXT NOT NULL,
  sha256_hex TEXT NOT NULL,
  applied_t_ns INTEGER NOT NULL
) STRICT;
INSERT INTO schema_migration VALUES(1,'initial','5b9e60fa88e5313cd602de900b5ef1fd26ec48251481d3a023274024847ee06c',1795952768109818727);
INSERT INTO schema_migration VALUES(2,'learning','ad11b0eed4c5aff882920b5fcc638e5259e0c6473959d36e0761e034016131e5',1795952768109818727);
INSERT INTO schema_migration VALUES(3,'evidence','9cc8bb069b7b00cc826ce0963d78aa7083e5eb65208fa55d54c1986363e232dd',1795952768109818727);
INSERT INTO schema_migration VALUES(4,'plan','b61b44684821815843481b6e9fdc70b291983fb47986fc58515f0ff89c06d2ce',1795952768109818727);
INSERT INTO schema_migration VALUES(5,'answer_headers','f6fddabd2c8bebecb1b9370fa20c1a691b2facf7483f685b5be0583a65374ef3',1795952768109818727);
INSERT INTO schema_migration VALUES(6,'flights_kept','fa850be7202896aa8b044cc8cab22219a207f27ab439030bb69bc0bbc91eae96',1795952768109818727);
INSERT INTO schema_migration VALUES(7,'what_is_believed','928ced75f17f95eee611eef5bcb10890a421087a2d744c12b04838d2bc94e8cc',1795952768109818727);
INSERT INTO schema_migration VALUES(8,'campaign_imports','993f088a1a82f736ed536f4af9fbb963034237ed191e6e299a8e5d4a46bceb2f',1795952768109818727);
INSERT INTO schema_migration VALUES(9,'webhooks','7c4ffeb6bd9e4aeb1810a60170fbca4d00fb10c4e5046f130dc0dc47fbdbec15',1795952768109818727);
INSERT INTO schema_migration VALUES(10,'places','098b135dddac37d59e25a60e4ca32042085fe09793cd02a168a2db795eed8968',1795952768109818727);
INSERT INTO schema_migration VALUES(11,'omlox_hubs','fb46c23aed9b18c6fb8d78f4b993f62c7c9955ea2d2f7ce173a314072fd736a2',1795952768109818727);
INSERT INTO schema_migration VALUES(12,'fixes_counted','772f473e05d3ce7c38825e4939476ca713a0069c8b4555c9abcce6f130781942',1795952768109818727);
INSERT INTO schema_migration VALUES(13,'plan_tiles','845d3d59444816e9878b0455545bdeeba14f292f9fcd6ca1591df6771568df0c',1795952768109818727);
INSERT INTO schema_migration VALUES(14,'lever_arm_sigma','07550435216e8f5b8dde3ec2b19bcbc653d17024461c3afb34ea1d91a477033b',1795952768109818727);
INSERT INTO schema_migration VALUES(15,'workers','c4d0c3098b96c7b66b1bcd1603afcbaf7bd527a53a085cbc772bf58472a4a1a6',1795952768109818727);
INSERT INTO schema_migration VALUES(16,'token_sites','6c1d5f68e7d310e7397bff93064ab2eea45da27703ed075ce627ae502304aafe',1795952768109818727);
INSERT INTO schema_migration VALUES(17,'mission_events','5abe94cc37df54a1682fdefdb3c80df458b0b9ae705057063c74231d15138763',1795952768109818727);
INSERT INTO schema_migration VALUES(18,'cir_archive','a321ed30ffc793ad0a3abe4a581d763e81c93057111c1585840c155e1043395a',1795952768109818727);
INSERT INTO schema_migration VALUES(19,'procedure_log','0f74240deb1acbb9558d993f5299545713624b395c4c161950a6738675df3792',1795952768109818727);
INSERT INTO schema_migration VALUES(20,'server_lease','1352e742a624fea1d90bef0c901052fca5fb74416b1de59078c4ec154e47d45b',1795952768109818727);
INSERT INTO schema_migration VALUES(21,'site_quotas','84c4b4519ba854471f06258236d51fe2308c585274418d8b00ee6d5fcd97d85f',1795952768109818727);
INSERT INTO schema_migration VALUES(22,'organizations','3f353be0ec3276795a2b41bdf12553b667b26e63b4b7c4972e07032bb0211cb2',1795952768109818727);
INSERT INTO schema_migration VALUES(23,'rows_in_bulk','6454ed717093a8f18de1950f6279cdb7371cbd5231d42d4b3ec364d97592f255',1795952768109818727);
INSERT INTO schema_migration VALUES(24,'browser_sessions','dd1416ca2fbf3db40b8c7f6366e2cedcf1a790ca18755680e1ed7695887820b4',1795952768109818727);
CREATE TABLE site (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  origin_lat_deg REAL,
  origin_lon_deg REAL,
  origin_height_m REAL,
  outline_geojson TEXT NOT NULL,
  crs_frame TEXT NOT NULL,
  crs_epoch_year REAL,
  base_sigma_m REAL,
  base_source TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
, projected_epsg INTEGER, organization_id BLOB REFERENCES organization (id)) STRICT, WITHOUT ROWID;
CREATE TABLE mission (
  mission_key INTEGER PRIMARY KEY, -- short form of the id, for the large tables
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  site_id BLOB REFERENCES site (id),
  name TEXT NOT NULL,
  kit TEXT NOT NULL,
  radio TEXT NOT NULL,
  frame INTEGER NOT NULL CHECK (frame IN (0, 1)),             -- 0 wgs84, 1 local
  track_point INTEGER NOT NULL CHECK (track_point BETWEEN 0 AND 2), -- 0 gnss_antenna, 1 body, 2 tag_antenna
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2),       -- 0 planned, 1 recording, 2 finished
  created_t_ns INTEGER NOT NULL,
  finished_t_ns INTEGER
, lever_arm_sigma_m REAL) STRICT;
INSERT INTO mission VALUES(1,X'019df2786f5973adbd769fb4d2eaab87',NULL,'stored flight','','',0,0,1,0,NULL,0.020000000000000000416);
CREATE TABLE mission_tag (
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  tag INTEGER NOT NULL,
  antenna INTEGER NOT NULL,
  lever_arm_forward_m REAL NOT NULL,
  lever_arm_left_m REAL NOT NULL,
  lever_arm_up_m REAL NOT NULL,
  PRIMARY KEY (mission_key, ordinal)
) STRICT, WITHOUT ROWID;
INSERT INTO mission_tag VALUES(1,0,28161,0,0.10000000000000000555,0.0,-0.11999999999999999555);
CREATE TABLE uwb_range (
  range_id INTEGER PRIMARY KEY,
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  kind INTEGER NOT NULL CHECK (kind IN (0, 1)), -- 0 tag_anchor, 1 anchor_anchor
  t_ns INTEGER NOT NULL,
  received_t_ns INTEGER,
  tag INTEGER NOT NULL,
  antenna INTEGER NOT NULL,
  anchor INTEGER NOT NULL,
  seq INTEGER,
  distance_m REAL NOT NULL,
  rss_dbm REAL,
  fp_dbm REAL,
  rx_dbm REAL,
  std_noise REAL,
  heading_deg REAL,
  truth_distance_m REAL,
  truth_los INTEGER CHECK (truth_los IN (0, 1))
) STRICT;
INSERT INTO uwb_range VALUES(1,1,0,1777889472345678000,NULL,28161,0,256,0,5.0,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO uwb_range VALUES(2,1,0,1777889472355678000,NULL,28161,0,257,1,5.0010000000000003339,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO uwb_range VALUES(3,1,0,1777889472365678000,NULL,28161,0,258,2,5.0019999999999997797,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE cir (
  range_id INTEGER PRIMARY KEY REFERENCES uwb_range (range_id) ON DELETE CASCADE,
  dt_ps REAL NOT NULL,
  first_path_idx REAL,
  preamble_count REAL,
  re_im BLOB NOT NULL -- int16 little endian: re, im, re, im, ...
) STRICT;
INSERT INTO cir VALUES(1,0.0,1.5,1001.0,X'0100ffff0200feff');
CREATE TABLE fix (
  fix_id INTEGER PRIMARY KEY,
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  t_ns INTEGER NOT NULL,
  received_t_ns INTEGER,
  seq INTEGER,
  frame INTEGER NOT NULL CHECK (frame IN (0, 1)),
  lat_deg REAL,
  lon_deg REAL,
  height_m REAL,
  x_m REAL,
  y_m REAL,
  z_m REAL,
  fix_class INTEGER NOT NULL CHECK (fix_class BETWEEN 0 AND 4), -- none, single, dgps, rtk_float, rtk_fixed
  cov_ee_m2 REAL,
  cov_en_m2 REAL,
  cov_eu_m2 REAL,
  cov_nn_m2 REAL,
  cov_nu_m2 REAL,
  cov_uu_m2 REAL,
  enu_from_body_x REAL,
  enu_from_body_y REAL,
  enu_from_body_z REAL,
  enu_from_body_w REAL,
  correction_age_s REAL,
  satellites INTEGER
) STRICT;
INSERT INTO fix VALUES(1,1,1777889472345678000,NULL,NULL,0,51.023123456789100773,3.7131234567890998299,58.411999999999999035,NULL,NULL,NULL,4,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
INSERT INTO fix VALUES(2,1,1777889472445678000,NULL,NULL,0,51.023123456789100773,3.7131234567890998299,58.411999999999999035,NULL,NULL,NULL,4,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL,NULL);
CREATE TABLE device_seen (
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  network_id INTEGER NOT NULL,
  kind INTEGER NOT NULL CHECK (kind IN (0, 1)), -- 0 tag, 1 anchor
  first_t_ns INTEGER NOT NULL,
  last_t_ns INTEGER NOT NULL,
  n_ranges INTEGER NOT NULL,
  PRIMARY KEY (mission_key, network_id, kind)
) STRICT, WITHOUT ROWID;
INSERT INTO device_seen VALUES(1,256,1,1777889472345678000,1777889472345678000,1);
INSERT INTO device_seen VALUES(1,257,1,1777889472355678000,1777889472355678000,1);
INSERT INTO device_seen VALUES(1,258,1,1777889472365678000,1777889472365678000,1);
INSERT INTO device_seen VALUES(1,28161,0,1777889472345678000,1777889472365678000,3);
CREATE TABLE anchor (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  network_id INTEGER NOT NULL UNIQUE,
  site_id BLOB REFERENCES site (id),
  name TEXT NOT NULL,
  building TEXT NOT NULL,
  floor TEXT NOT NULL,
  space TEXT NOT NULL,
  asset_tag TEXT NOT NULL,
  ifc_guid TEXT NOT NULL,
  retired INTEGER NOT NULL CHECK (retired IN (0, 1)),
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
INSERT INTO anchor VALUES(X'019df2786f5973adbd769fb5687bbcf3',256,NULL,'','','','','','',0,1777889472345678000,1);
CREATE TABLE anchor_external_id (
  anchor_id BLOB NOT NULL REFERENCES anchor (id) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  system TEXT NOT NULL,
  external_id TEXT NOT NULL,
  PRIMARY KEY (anchor_id, ordinal)
) STRICT, WITHOUT ROWID;
CREATE TABLE calibration (
  calibration_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  frame INTEGER NOT NULL CHECK (frame IN (0, 1)),
  origin_lat_deg REAL,
  origin_lon_deg REAL,
  origin_height_m REAL,
  settings_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL
, provenance_json TEXT NOT NULL DEFAULT '{}') STRICT;
INSERT INTO calibration VALUES(1,X'019df2786f5973adbd769fb5d6923608',0,NULL,NULL,NULL,'',0,'{}');
CREATE TABLE calibration_mission (
  calibration_key INTEGER NOT NULL REFERENCES calibration (calibration_key) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key),
  PRIMARY KEY (calibration_key, ordinal)
) STRICT, WITHOUT ROWID;
INSERT INTO calibration_mission VALUES(1,0,1);
CREATE TABLE estimate (
  calibration_key INTEGER NOT NULL REFERENCES calibration (calibration_key) ON DELETE CASCADE,
  network_id INTEGER NOT NULL,
  ordinal INTEGER NOT NULL,
  t_ns INTEGER NOT NULL,
  verdict INTEGER NOT NULL CHECK (verdict BETWEEN 0 AND 4), -- ok, weak_geometry, ambiguous, too_few, diverged
  reason TEXT NOT NULL,
  h95_m REAL,
  v95_m REAL,
  gdop REAL,
  gdop_trace REAL,
  n_used INTEGER NOT NULL,
  bias_m REAL,
  bias_sigma_m REAL,
  lag_s REAL,
  lag_sigma_s REAL,
  PRIMARY KEY (calibration_key, network_id)
) STRICT, WITHOUT ROWID;
INSERT INTO estimate VALUES(1,256,0,0,3,'',0.0,0.0,NULL,NULL,0,NULL,NULL,NULL,NULL);
CREATE TABLE hypothesis (
  calibration_key INTEGER NOT NULL,
  network_id INTEGER NOT NULL,
  is_mirror INTEGER NOT NULL CHECK (is_mirror IN (0, 1)),
  e_m REAL NOT NULL,
  n_m REAL NOT NULL,
  u_m REAL NOT NULL,
  lat_deg REAL,
  lon_deg REAL,
  height_m REAL,
  cov_ee_m2 REAL,
  cov_en_m2 REAL,
  cov_eu_m2 REAL,
  cov_nn_m2 REAL,
  cov_nu_m2 REAL,
  cov_uu_m2 REAL,
  rms_residual_m REAL,
  probability REAL,
  PRIMARY KEY (calibration_key, network_id, is_mirror),
  FOREIGN KEY (calibration_key, network_id) REFERENCES estimate (calibration_key, network_id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
INSERT INTO hypothesis VALUES(1,256,0,0.0,0.0,0.0,NULL,NULL,NULL,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0);
CREATE TABLE estimate_refused (
  calibration_key INTEGER NOT NULL,
  network_id INTEGER NOT NULL,
  reason TEXT NOT NULL,
  n_ranges INTEGER NOT NULL,
  PRIMARY KEY (calibration_key, network_id, reason),
  FOREIGN KEY (calibration_key, network_id) REFERENCES estimate (calibration_key, network_id) ON DELETE CASCADE
) STRICT, WITHOUT ROWID;
CREATE TABLE revision (
  number INTEGER PRIMARY KEY,
  calibration_key INTEGER NOT NULL REFERENCES calibration (calibration_key),
  published_t_ns INTEGER NOT NULL,
  published_by TEXT NOT NULL,
  note TEXT NOT NULL
) STRICT;
INSERT INTO revision VALUES(1,1,1777889472345678000,'token','note');
CREATE TABLE revision_position (
  number INTEGER NOT NULL REFERENCES revision (number),
  network_id INTEGER NOT NULL,
  since_number INTEGER NOT NULL REFERENCES revision (number),
  PRIMARY KEY (number, network_id)
) STRICT, WITHOUT ROWID;
INSERT INTO revision_position VALUES(1,256,1);
CREATE TABLE token (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  secret_sha256_hex TEXT NOT NULL UNIQUE,
  created_t_ns INTEGER NOT NULL,
  expires_t_ns INTEGER,
  revoked_t_ns INTEGER,
  last_used_t_ns INTEGER
, bound INTEGER NOT NULL DEFAULT 0 CHECK (bound IN (0, 1)), organization_id BLOB CHECK (length(organization_id) = 16), requests_per_minute INTEGER CHECK (requests_per_minute > 0)) STRICT, WITHOUT ROWID;
CREATE TABLE token_role (
  token_id BLOB NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  role TEXT NOT NULL,
  PRIMARY KEY (token_id, ordinal)
) STRICT, WITHOUT ROWID;
CREATE TABLE job (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  kind TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 4), -- queued, running, succeeded, failed, canceled
  fraction REAL NOT NULL,
  stage TEXT NOT NULL,
  detail TEXT NOT NULL,
  result_href TEXT NOT NULL,
  problem_json TEXT NOT NULL,
  request_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  started_t_ns INTEGER,
  finished_t_ns INTEGER
, worker TEXT NOT NULL DEFAULT '', attempts INTEGER NOT NULL DEFAULT 0) STRICT, WITHOUT ROWID;
CREATE TABLE stored_answer (
  principal TEXT NOT NULL,
  idempotency_key TEXT NOT NULL,
  request_sha256_hex TEXT NOT NULL,
  status INTEGER NOT NULL,
  body BLOB NOT NULL,
  created_t_ns INTEGER NOT NULL, location TEXT NOT NULL DEFAULT '', etag TEXT NOT NULL DEFAULT '',
  PRIMARY KEY (principal, idempotency_key)
) STRICT, WITHOUT ROWID;
CREATE TABLE audit (
  number INTEGER PRIMARY KEY,
  t_ns INTEGER NOT NULL,
  who TEXT NOT NULL,
  what TEXT NOT NULL,
  from_where TEXT NOT NULL,
  result TEXT NOT NULL,
  chain_sha256_hex TEXT NOT NULL
) STRICT;
INSERT INTO audit VALUES(1,1777889472345678000,'token','publish','127.0.0.1','ok','dfeb043534c3359e2dc5f761cc04ad2f63c6db6a66ddb593db6959ffcde772bb');
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
CREATE TABLE campaign_cir (
  sample_id INTEGER PRIMARY KEY REFERENCES campaign_sample (sample_id) ON DELETE CASCADE,
  dt_ps REAL NOT NULL,
  first_path_idx REAL,
  preamble_count REAL,
  re_im BLOB NOT NULL -- int16 little endian: re, im, re, im, ...
) STRICT;
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
, signature TEXT NOT NULL DEFAULT '') STRICT;
CREATE TABLE model_artifact (
  model_key INTEGER PRIMARY KEY REFERENCES model (model_key) ON DELETE CASCADE,
  json TEXT NOT NULL
) STRICT;
CREATE TABLE model_promotion (
  number INTEGER PRIMARY KEY,
  task TEXT NOT NULL,
  model_key INTEGER REFERENCES model (model_key),
  t_ns INTEGER NOT NULL,
  promoted_by TEXT NOT NULL,
  reason TEXT NOT NULL,
  is_rollback INTEGER NOT NULL CHECK (is_rollback IN (0, 1))
) STRICT;
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
CREATE TABLE revision_override (
  number INTEGER NOT NULL REFERENCES revision (number),
  network_id INTEGER NOT NULL,
  reason TEXT NOT NULL CHECK (reason <> ''),
  overridden_by TEXT NOT NULL,
  PRIMARY KEY (number, network_id)
) STRICT, WITHOUT ROWID;
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
CREATE TABLE plan (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  site_id BLOB REFERENCES site (id),
  document_json TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  changed_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE mission_procedure (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  state_json TEXT NOT NULL,
  changed_t_ns INTEGER NOT NULL
) STRICT;
CREATE TABLE mission_bin (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  deleted_t_ns INTEGER NOT NULL,
  deleted_ran_ns INTEGER NOT NULL,
  deleted_by TEXT NOT NULL,
  emptying INTEGER NOT NULL CHECK (emptying IN (0, 1)) -- 1: its rows are being removed
) STRICT;
CREATE TABLE service_state (
  one INTEGER PRIMARY KEY CHECK (one = 1),
  running_ns INTEGER NOT NULL -- how long this database has been served, over all starts
) STRICT;
INSERT INTO service_state VALUES(1,0);
CREATE TABLE device_stream (
  position INTEGER PRIMARY KEY,
  mission_key INTEGER NOT NULL UNIQUE REFERENCES mission (mission_key) ON DELETE CASCADE
) STRICT;
CREATE TABLE exclusion (
  exclusion_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  kind INTEGER NOT NULL CHECK (kind IN (0, 1)), -- 0 ranges, 1 fixes
  since_t_ns INTEGER,
  until_t_ns INTEGER, -- not included
  anchor INTEGER,
  tag INTEGER,
  n_rows INTEGER NOT NULL,
  reason TEXT NOT NULL CHECK (reason <> ''),
  created_t_ns INTEGER NOT NULL,
  created_by TEXT NOT NULL
) STRICT;
CREATE TABLE exclusion_row (
  exclusion_key INTEGER NOT NULL REFERENCES exclusion (exclusion_key) ON DELETE CASCADE,
  t_ns INTEGER NOT NULL,
  tag INTEGER NOT NULL,
  anchor INTEGER NOT NULL,
  antenna INTEGER NOT NULL,
  PRIMARY KEY (exclusion_key, t_ns, tag, anchor, antenna)
) STRICT, WITHOUT ROWID;
CREATE TABLE exclusion_taken_back (
  exclusion_key INTEGER PRIMARY KEY REFERENCES exclusion (exclusion_key) ON DELETE CASCADE,
  reason TEXT NOT NULL,
  t_ns INTEGER NOT NULL,
  taken_back_by TEXT NOT NULL
) STRICT;
CREATE TABLE campaign_import (
  campaign_key INTEGER NOT NULL REFERENCES campaign (campaign_key) ON DELETE CASCADE,
  digest TEXT NOT NULL,
  PRIMARY KEY (campaign_key, digest)
) STRICT, WITHOUT ROWID;
CREATE TABLE webhook (
  webhook_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  name TEXT NOT NULL,
  url TEXT NOT NULL,
  secret TEXT NOT NULL,
  events TEXT NOT NULL,
  enabled INTEGER NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
, kind INTEGER NOT NULL DEFAULT 0, dialect INTEGER NOT NULL DEFAULT 0, token TEXT NOT NULL DEFAULT '') STRICT;
CREATE TABLE webhook_delivery (
  delivery_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  webhook_key INTEGER NOT NULL REFERENCES webhook (webhook_key) ON DELETE CASCADE,
  event TEXT NOT NULL,
  body TEXT NOT NULL,
  state INTEGER NOT NULL,
  created_t_ns INTEGER NOT NULL,
  attempts INTEGER NOT NULL,
  due_ran_ns INTEGER NOT NULL,
  tried_t_ns INTEGER,
  status INTEGER,
  fault TEXT NOT NULL
) STRICT;
CREATE TABLE building (
  building_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  site_id BLOB NOT NULL REFERENCES site (id),
  name TEXT NOT NULL,
  height_m REAL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;
CREATE TABLE building_floor (
  floor_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  building_id BLOB NOT NULL REFERENCES building (id),
  name TEXT NOT NULL,
  level REAL NOT NULL,
  base_height_m REAL,
  georeference TEXT NOT NULL,
  proposal TEXT NOT NULL,
  structure TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT;
CREATE TABLE plan_image (
  image_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  floor_id BLOB NOT NULL REFERENCES building_floor (id) ON DELETE CASCADE,
  kind INTEGER NOT NULL,
  named INTEGER NOT NULL,
  media_type TEXT NOT NULL,
  width_px INTEGER NOT NULL,
  height_px INTEGER NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL
) STRICT;
CREATE TABLE plan_image_part (
  image_id BLOB NOT NULL REFERENCES plan_image (id) ON DELETE CASCADE,
  ordinal INTEGER NOT NULL,
  content BLOB NOT NULL,
  PRIMARY KEY (image_id, ordinal)
) STRICT;
CREATE TABLE mission_fixes (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  n_fixes INTEGER NOT NULL
) STRICT;
INSERT INTO mission_fixes VALUES(1,2);
CREATE TABLE plan_tiles (
  tiles_key INTEGER PRIMARY KEY,
  id BLOB NOT NULL UNIQUE,
  floor_id BLOB REFERENCES building_floor (id) ON DELETE SET NULL,
  named INTEGER NOT NULL,
  n_levels INTEGER NOT NULL,
  m_per_px REAL NOT NULL,
  width_px INTEGER NOT NULL,
  height_px INTEGER NOT NULL,
  west_m REAL NOT NULL,
  north_m REAL NOT NULL,
  bytes INTEGER NOT NULL,
  sha256 TEXT NOT NULL
) STRICT;
CREATE TABLE plan_tile (
  tile_key INTEGER PRIMARY KEY,
  tiles_id BLOB NOT NULL REFERENCES plan_tiles (id),
  level INTEGER NOT NULL,
  tile_column INTEGER NOT NULL,
  tile_row INTEGER NOT NULL,
  content BLOB NOT NULL,
  UNIQUE (tiles_id, level, tile_column, tile_row)
) STRICT;
CREATE TABLE work (
  job_id BLOB PRIMARY KEY REFERENCES job (id) ON DELETE CASCADE,
  kind TEXT NOT NULL,
  version TEXT NOT NULL, -- of anchord: no other claims it
  message TEXT NOT NULL,
  state INTEGER NOT NULL CHECK (state BETWEEN 0 AND 2), -- open, claimed, done
  fence INTEGER NOT NULL, -- grows with every claim
  attempts INTEGER NOT NULL,
  max_attempts INTEGER NOT NULL,
  worker TEXT NOT NULL, -- of the newest claim
  open_t_ns INTEGER NOT NULL, -- since when it waits
  lease_t_ns INTEGER NOT NULL, -- until when the claim holds
  cancel_wanted INTEGER NOT NULL CHECK (cancel_wanted IN (0, 1)),
  fraction REAL NOT NULL,
  stage TEXT NOT NULL,
  detail TEXT NOT NULL,
  fault TEXT NOT NULL, -- why the attempt before this one ended
  result TEXT, -- NULL: there is none
  error_code TEXT NOT NULL,
  error_text TEXT NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE worker (
  name TEXT NOT NULL PRIMARY KEY,
  version TEXT NOT NULL,
  started_t_ns INTEGER NOT NULL,
  seen_t_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE token_site (
  token_id BLOB NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  site_id BLOB NOT NULL CHECK (length(site_id) = 16),
  PRIMARY KEY (token_id, site_id)
) STRICT, WITHOUT ROWID;
CREATE TABLE mission_event (
  event_key INTEGER PRIMARY KEY, -- in the order in which they came
  id BLOB NOT NULL UNIQUE CHECK (length(id) = 16),
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  t_ns INTEGER NOT NULL,
  level INTEGER NOT NULL CHECK (level IN (0, 1, 2)), -- 0 info, 1 warning, 2 critical
  code TEXT NOT NULL,
  text TEXT NOT NULL,
  lat_deg REAL, -- where the aircraft is sent by it: all three or none
  lon_deg REAL,
  height_above_ground_m REAL
) STRICT;
CREATE TABLE cir_moved (
  range_id INTEGER PRIMARY KEY REFERENCES uwb_range (range_id) ON DELETE CASCADE,
  digest BLOB NOT NULL CHECK (length(digest) = 32)
) STRICT;
CREATE TABLE cir_archive (
  mission_key INTEGER PRIMARY KEY REFERENCES mission (mission_key) ON DELETE CASCADE,
  n_ranges INTEGER NOT NULL, -- that the flight had when it was last gone through; another number: there is more to move
  held INTEGER NOT NULL CHECK (held IN (0, 1)), -- brought back by somebody: not moved again by the rule
  file TEXT NOT NULL, -- empty: the flight has no impulse responses
  place TEXT NOT NULL, -- machine and folder in which the file was written
  sha256_hex TEXT NOT NULL,
  file_bytes INTEGER NOT NULL,
  n_cirs INTEGER NOT NULL, -- in the file
  n_moved INTEGER NOT NULL, -- of these, no longer in the database
  archived_t_ns INTEGER NOT NULL
) STRICT;
CREATE TABLE procedure_log (
  mission_key INTEGER NOT NULL REFERENCES mission (mission_key) ON DELETE CASCADE,
  number INTEGER NOT NULL, -- from 1, in the order in which they came
  t_ns INTEGER NOT NULL,
  topic TEXT NOT NULL,
  message_json TEXT NOT NULL,
  PRIMARY KEY (mission_key, number)
) STRICT;
CREATE TABLE server_lease (
  one INTEGER PRIMARY KEY CHECK (one = 1),
  server TEXT NOT NULL,
  fence INTEGER NOT NULL, -- one more with every server that takes it
  lease_t_ns INTEGER NOT NULL, -- by the database's clock; 0: given back
  standby TEXT NOT NULL, -- who waits for it; empty: nobody yet
  standby_t_ns INTEGER NOT NULL -- when that was last heard of
) STRICT;
CREATE TABLE site_quota (
  site_id BLOB PRIMARY KEY REFERENCES site (id) ON DELETE CASCADE,
  max_missions INTEGER CHECK (max_missions >= 0),
  max_measurements INTEGER CHECK (max_measurements >= 0), -- ranges and fixes
  max_anchors INTEGER CHECK (max_anchors >= 0)
) STRICT, WITHOUT ROWID;
CREATE TABLE organization (
  id BLOB PRIMARY KEY CHECK (length(id) = 16),
  name TEXT NOT NULL,
  description TEXT NOT NULL,
  created_t_ns INTEGER NOT NULL,
  version INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE TABLE organization_quota (
  organization_id BLOB PRIMARY KEY REFERENCES organization (id) ON DELETE CASCADE,
  max_missions INTEGER CHECK (max_missions >= 0),
  max_measurements INTEGER CHECK (max_measurements >= 0),
  max_anchors INTEGER CHECK (max_anchors >= 0),
  max_sites INTEGER CHECK (max_sites >= 0),
  requests_per_minute INTEGER CHECK (requests_per_minute > 0)
) STRICT, WITHOUT ROWID;
CREATE TABLE browser_session (
  cookie_sha256_hex TEXT PRIMARY KEY,
  token_id BLOB NOT NULL REFERENCES token (id) ON DELETE CASCADE,
  until_t_ns INTEGER NOT NULL
) STRICT, WITHOUT ROWID;
CREATE UNIQUE INDEX uwb_range_identity ON uwb_range (mission_key, t_ns, tag, anchor, antenna, ifnull(seq, -1));
CREATE INDEX uwb_range_time ON uwb_range (t_ns);
CREATE UNIQUE INDEX fix_identity ON fix (mission_key, t_ns, ifnull(seq, -1));
CREATE INDEX fix_time ON fix (t_ns);
CREATE INDEX calibration_mission_mission ON calibration_mission (mission_key);
CREATE INDEX revision_calibration ON revision (calibration_key);
CREATE INDEX revision_position_network_id ON revision_position (network_id, number);
CREATE INDEX stored_answer_created ON stored_answer (created_t_ns);
CREATE TRIGGER audit_keeps_what_it_says BEFORE UPDATE ON audit
BEGIN
  SELECT RAISE (ABORT, 'the audit log is append-only');
END;
CREATE TRIGGER audit_keeps_its_rows BEFORE DELETE ON audit
BEGIN
  SELECT RAISE (ABORT, 'the audit log is append-only');
END;
CREATE TRIGGER uwb_range_keeps_what_was_measured
BEFORE UPDATE OF mission_key, kind, t_ns, tag, antenna, anchor, seq, distance_m ON uwb_range
BEGIN
  SELECT RAISE (ABORT, 'measurements are append-only');
END;
CREATE TRIGGER fix_keeps_what_was_measured BEFORE UPDATE ON fix
BEGIN
  SELECT RAISE (ABORT, 'measurements are append-only');
END;
CREATE INDEX campaign_sample_setting ON campaign_sample (setting_key, sample_id);
CREATE UNIQUE INDEX campaign_sample_identity ON campaign_sample (setting_key, t_ns, ifnull(seq, -1)) WHERE t_ns IS NOT NULL;
CREATE INDEX training_run_dataset ON training_run (dataset_key);
CREATE INDEX model_run ON model (run_key);
CREATE INDEX model_promotion_task ON model_promotion (task, number);
CREATE INDEX model_promotion_model ON model_promotion (model_key);
CREATE INDEX local_frame_site ON local_frame (site_id);
CREATE INDEX exclusion_mission ON exclusion (mission_key);
CREATE TRIGGER exclusion_keeps_what_it_says BEFORE UPDATE ON exclusion
BEGIN
  SELECT RAISE (ABORT, 'exclusions are append-only');
END;
CREATE INDEX webhook_delivery_of ON webhook_delivery (webhook_key, delivery_key);
CREATE INDEX webhook_delivery_due ON webhook_delivery (due_ran_ns) WHERE state = 0;
CREATE INDEX building_of_site ON building (site_id);
CREATE INDEX floor_of_building ON building_floor (building_id);
CREATE INDEX plan_image_of_floor ON plan_image (floor_id);
CREATE INDEX fix_class_time ON fix (mission_key, fix_class, t_ns);
CREATE INDEX plan_tiles_of_floor ON plan_tiles (floor_id);
CREATE INDEX mission_event_mission ON mission_event (mission_key, event_key);
CREATE INDEX mission_of_site ON mission (site_id);
CREATE INDEX anchor_of_site ON anchor (site_id);
CREATE INDEX site_of_organization ON site (organization_id, id);
COMMIT;
