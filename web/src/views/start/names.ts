/// What a column of a flight's tables can be, and the names under which loggers write it. No DOM.
/// Without those that `missing_*` names there is no flight.
export const TRACK_FIELDS = [
  'time',
  'zone',
  'lat',
  'lon',
  'lat_hemisphere',
  'lon_hemisphere',
  'height',
  'separation',
  'x',
  'y',
  'z',
  'fix',
  'sigma_h',
  'sigma_v',
  'heading',
] as const;
export const RANGE_FIELDS = ['time', 'zone', 'anchor', 'range', 'tag', 'rss', 'rx', 'fp', 'seq'] as const;
export type TrackField =
  (typeof TRACK_FIELDS)[number] | 'sigma_e' | 'sigma_n' | 'age' | 'satellites' | 'qx' | 'qy' | 'qz' | 'qw';
export type RangeField = (typeof RANGE_FIELDS)[number] | 'antenna' | 'kind';
export type Field = TrackField | RangeField;
export type Columns = Readonly<Partial<Record<Field, string>>>;
export const FIELD_WORDS: Record<(typeof TRACK_FIELDS)[number] | (typeof RANGE_FIELDS)[number], string> = {
  time: 'Time',
  zone: 'Zone of the time',
  lat: 'Latitude, °',
  lon: 'Longitude, °',
  lat_hemisphere: 'N or S',
  lon_hemisphere: 'E or W',
  height: 'Height, m',
  separation: 'Height of the geoid, m',
  x: 'x or easting, m',
  y: 'y or northing, m',
  z: 'z or height, m',
  fix: 'Fix class',
  sigma_h: 'σ horizontal, m',
  sigma_v: 'σ vertical, m',
  heading: 'Heading',
  anchor: 'Anchor',
  range: 'Range',
  tag: 'Tag',
  rss: 'RSS, dBm',
  rx: 'Receive power, dBm',
  fp: 'First path power, dBm',
  seq: 'Number of the row',
};
const TIMES =
  't_s t_us t_ms t_ns time time_s time_ms time_us time_ns time_utc time_utc_usec timestamp timestamp_s timestamp_ms timestamp_us timestamp_ns t utc ' +
  'gpst gps_time unix datetime date_time zeit time_unix_usec time_usec timeus timems time_boot_ms t_utc';
export const NAMES: Readonly<Record<Field, string>> = {
  time: TIMES,
  zone: 'tz timezone time_zone utc_offset tz_offset gmt_offset zeitzone',
  lat: 'lat_deg lat latitude latitude_deg breite',
  lon: 'lon_deg lon lng longitude longitude_deg laenge',
  lat_hemisphere:
    'n_s ns lat_dir latitude_dir lat_direction latitude_direction lat_ref latitude_ref lat_hemi lat_hemisphere latitude_hemisphere lat_ns north_south ' +
    'ns_indicator n_s_indicator hemisphere',
  lon_hemisphere:
    'e_w ew lon_dir longitude_dir lon_direction longitude_direction lon_ref longitude_ref lon_hemi lon_hemisphere longitude_hemisphere lon_ew east_west ' +
    'ew_indicator e_w_indicator lng_dir lng_ref hemisphere',
  height:
    'h_m h_ell h_ell_m height_ell hoehe_ell ell_height ellipsoidal_height height_ellipsoid ' +
    'height_ellipsoid_m ellipsoid_height altitude_ellipsoid_m alt_ellipsoid alt_hae hae ' +
    'alt_m height_m alt altitude height h altitude_m hoehe alt_msl alt_msl_m altitude_msl altitude_msl_m height_msl height_msl_m msl hmsl orthometric_height',
  separation:
    'geoid_separation geoid_separation_m geoid_sep geoidal_separation undulation undulation_m geoid_height geoid_height_m geoid_undulation',
  x:
    'x_m x e_m east east_m easting easting_m e rechtswert ostwert x_ecef_m ecef_x ecef_x_m e_baseline_m ' +
    'pe pe_m pos_e pos_e_m x_ned ned_x pos_ned_x pos_ned_0',
  y:
    'y_m y n_m north north_m northing northing_m n hochwert nordwert y_ecef_m ecef_y ecef_y_m n_baseline_m ' +
    'pn pn_m pos_n pos_n_m y_ned ned_y pos_ned_y pos_ned_1',
  z:
    'z_m z u_m up up_m z_ecef_m ecef_z ecef_z_m u_baseline_m ' +
    'pd pd_m pos_d pos_d_m down down_m z_ned ned_z pos_ned_z pos_ned_2',
  fix: 'fix fix_type quality fix_quality gps_qual rtk q carrsoln status',
  sigma_h: 'sd_h_m sigma_h_m hacc h_acc sd_h',
  sigma_v: 'sd_v_m sigma_v_m vacc v_acc sd_v sdu_m sigma_u_m',
  sigma_e: 'sde_m sigma_e_m',
  sigma_n: 'sdn_m sigma_n_m',
  age: 'correction_age_s age_s age',
  satellites: 'satellites sats num_sv ns nsats satellites_used',
  heading: 'heading_deg heading yaw_deg yaw',
  qx: 'qx',
  qy: 'qy',
  qz: 'qz',
  qw: 'qw',
  anchor: 'anchor_id anchor anchor_address anchor_name remote remote_id dest destination anker',
  range:
    'range_m distance_m range distance dist range_mm distance_mm dist_m dist_mm range_cm distance_cm abstand ' +
    'entfernung entfernung_m entfernung_cm entfernung_mm',
  tag: 'tag_id tag tag_address source local_id',
  rss: 'rss_dbm rss rssi',
  rx: 'rx_dbm rx_power rx',
  fp: 'fp_dbm fp_power first_path_dbm',
  seq: 'seq sequence',
  antenna: 'antenna',
  kind: 'kind',
};
/// A name however it was spelled: small letters and digits, parts joined by "_".
export const plain = (s: string): string =>
  s
    .toLowerCase()
    .replaceAll('ä', 'ae')
    .replaceAll('ö', 'oe')
    .replaceAll('ü', 'ue')
    .replaceAll(/[^a-z0-9]+/g, '_')
    .replace(/^_|_$/g, '');
