/// A flight from files: tables of track and ranges, columns told by their names or by a person, as rows of the API. docs/formats.md. No DOM.
import type { Wire } from '../../api/contract';
import { num, obj, str } from '../../live/messages';

export interface Table {
  readonly name: string;
  readonly columns: readonly string[];
  readonly rows: readonly (readonly string[])[];
}
const MAX_ROWS = 2_000_000;

/// Comma, semicolon or tab; a header line of names, no quotes. Error: what is wrong and in which line.
export function table_of(name: string, text: string): Table {
  const lines = text.split(/\r?\n/).filter((l) => l.trim() !== '' && !l.startsWith('#')),
    head = lines[0] ?? '',
    comma = [',', ';', '\t'].reduce((a, b) => (head.split(b).length > head.split(a).length ? b : a)),
    columns = head.split(comma).map((c) => c.trim());
  if (lines.length < 2) throw new Error(`${name}: a header line and at least one row are needed`);
  if (lines.length > MAX_ROWS) throw new Error(`${name}: ${lines.length} rows, at most ${MAX_ROWS}`);
  if (columns.every((c) => c !== '' && Number.isFinite(Number(c))))
    throw new Error(`${name}: the first line is numbers, a header line of names is needed`);
  const rows = lines.slice(1).map((l, i) => {
    const cells = l.split(comma).map((c) => c.trim());
    if (cells.length !== columns.length)
      throw new Error(`${name} line ${i + 2}: ${cells.length} cells, the header has ${columns.length}`);
    return cells;
  });
  return { name, columns, rows };
}

/// What a column can be. Without those marked `needed` there is no flight.
export const TRACK_FIELDS = ['time', 'lat', 'lon', 'height', 'x', 'y', 'z', 'fix', 'sigma_h', 'sigma_v'] as const;
export const RANGE_FIELDS = ['time', 'anchor', 'range', 'tag', 'rss', 'rx', 'fp', 'seq'] as const;
export type TrackField = (typeof TRACK_FIELDS)[number] | 'age' | 'satellites' | 'heading' | 'qx' | 'qy' | 'qz' | 'qw';
export type RangeField = (typeof RANGE_FIELDS)[number] | 'antenna' | 'kind';
export type Field = TrackField | RangeField;
export type Columns = Readonly<Partial<Record<Field, string>>>;
export const FIELD_WORDS: Record<(typeof TRACK_FIELDS)[number] | (typeof RANGE_FIELDS)[number], string> = {
  time: 'Time',
  lat: 'Latitude, °',
  lon: 'Longitude, °',
  height: 'Height above ellipsoid, m',
  x: 'x, m',
  y: 'y, m',
  z: 'z, m',
  fix: 'Fix class',
  sigma_h: 'σ horizontal, m',
  sigma_v: 'σ vertical, m',
  anchor: 'Anchor',
  range: 'Range',
  tag: 'Tag',
  rss: 'RSS, dBm',
  rx: 'Receive power, dBm',
  fp: 'First path power, dBm',
  seq: 'Number of the row',
};
const NAMES: Readonly<Record<Field, readonly string[]>> = {
  time: [
    't_s',
    't_us',
    't_ms',
    'time',
    'time_ms',
    'time_utc',
    'timestamp',
    't',
    'utc',
    'gps_time',
    'time_s',
    'time_us',
    'unix',
    'datetime',
  ],
  lat: ['lat_deg', 'lat', 'latitude'],
  lon: ['lon_deg', 'lon', 'lng', 'longitude'],
  height: ['alt_m', 'h_m', 'height_m', 'alt', 'altitude', 'height', 'ellipsoidal_height'],
  x: ['x_m', 'x', 'e_m', 'east', 'east_m'],
  y: ['y_m', 'y', 'n_m', 'north', 'north_m'],
  z: ['z_m', 'z', 'u_m', 'up', 'up_m'],
  fix: ['fix', 'fix_type', 'quality', 'rtk'],
  sigma_h: ['sd_h_m', 'sigma_h_m', 'hacc', 'h_acc', 'sd_h'],
  sigma_v: ['sd_v_m', 'sigma_v_m', 'vacc', 'v_acc', 'sd_v'],
  age: ['correction_age_s', 'age_s', 'age'],
  satellites: ['satellites', 'sats', 'num_sv'],
  heading: ['heading_deg', 'heading', 'yaw_deg', 'yaw'],
  qx: ['qx'],
  qy: ['qy'],
  qz: ['qz'],
  qw: ['qw'],
  anchor: ['anchor_id', 'anchor', 'anchor_address', 'remote', 'remote_id', 'dest', 'destination'],
  range: ['range_m', 'distance_m', 'range', 'distance', 'dist', 'range_mm', 'distance_mm', 'dist_m', 'dist_mm'],
  tag: ['tag_id', 'tag', 'tag_address', 'source', 'local_id'],
  rss: ['rss_dbm', 'rss', 'rssi'],
  rx: ['rx_dbm', 'rx_power', 'rx'],
  fp: ['fp_dbm', 'fp_power', 'first_path_dbm'],
  seq: ['seq', 'sequence'],
  antenna: ['antenna'],
  kind: ['kind'],
};
const plain = (s: string): string =>
  s
    .toLowerCase()
    .replaceAll(/[^a-z0-9]+/g, '_')
    .replace(/^_|_$/g, '');

/// The columns by their names, the usual name of a field first.
export function guessed(t: Table, fields: readonly Field[]): Columns {
  const by_name = new Map(t.columns.map((c) => [plain(c), c])),
    out: Partial<Record<Field, string>> = {};
  for (const f of fields) {
    const name = NAMES[f].find((n) => by_name.has(n));
    if (name) out[f] = by_name.get(name)!;
  }
  return out;
}
export const guessed_track = (t: Table): Columns =>
  guessed(t, [...TRACK_FIELDS, 'age', 'satellites', 'heading', 'qx', 'qy', 'qz', 'qw']);
export const guessed_ranges = (t: Table): Columns => guessed(t, [...RANGE_FIELDS, 'antenna', 'kind']);
export const missing_track = (c: Columns): readonly Field[] => {
  const globe = (['lat', 'lon', 'height'] as const).filter((f) => !c[f]),
    local = (['x', 'y', 'z'] as const).filter((f) => !c[f]);
  return [...(c.time ? [] : (['time'] as const)), ...(globe.length && local.length ? globe : [])];
};
export const missing_ranges = (c: Columns): readonly Field[] =>
  (['time', 'anchor', 'range'] as const).filter((f) => !c[f]);

export type TimeUnit = 's' | 'ms' | 'us' | 'utc';
/// By the name of the column, else by how its first value looks.
export function time_unit(t: Table, column: string | undefined): TimeUnit {
  const name = plain(column ?? ''),
    first = t.rows[0]?.[t.columns.indexOf(column ?? '')] ?? '';
  if (/[T:]/.test(first)) return 'utc';
  if (name.endsWith('_us')) return 'us';
  if (name.endsWith('_ms')) return 'ms';
  const v = Number(first);
  return v > 1e14 ? 'us' : v > 1e11 ? 'ms' : 's';
}
export function range_unit(t: Table, column: string | undefined): 'm' | 'mm' {
  if (plain(column ?? '').endsWith('_mm')) return 'mm';
  const i = t.columns.indexOf(column ?? ''),
    values = t.rows.slice(0, 200).map((r) => Number(r[i]));
  return !plain(column ?? '').endsWith('_m') && values.filter((v) => v > 400).length > values.length / 2 ? 'mm' : 'm';
}

/// What no table says.
export interface About {
  readonly name: string;
  readonly kit: string;
  readonly epoch_ms: number; ///< of t = 0, where times are seconds of the flight
  readonly point: 'gnss_antenna' | 'body' | 'tag_antenna';
  readonly lever_arm_m: readonly [number, number, number];
  readonly lever_arm_sigma_m: number | null; ///< how well the arms were measured; null: nobody says
  readonly tag: string; ///< where no column says it
}
export interface Declared {
  readonly about: Partial<About>;
  readonly tags: NonNullable<Wire<'MissionCreate'>['tags']> | null;
  readonly heading: { readonly column: string; readonly add_deg: number } | null;
}
/// flight.json, as far as it is told.
export function declared_of(text: string): Declared {
  const o = obj(JSON.parse(text));
  if (!o) throw new Error('flight.json: an object is needed');
  const track = obj(o.track),
    point = str(track?.point),
    list = Array.isArray(o.tags) ? o.tags.map(obj).filter((t) => t !== null) : [],
    tags = list.map((t) => ({
      tag: str(t.tag_id),
      antenna: num(t.antenna) ?? 0,
      lever_arm_body_m: (Array.isArray(t.lever_arm_body_m) ? t.lever_arm_body_m : [0, 0, 0]) as [
        number,
        number,
        number,
      ],
    }));
  const epoch_ms = Date.parse(str(o.epoch_utc)),
    lever_arm_sigma_m = num(o.lever_arm_sigma_m);
  return {
    about: {
      ...(str(o.name) ? { name: str(o.name) } : {}),
      ...(str(o.kit) ? { kit: str(o.kit) } : {}),
      ...(Number.isNaN(epoch_ms) ? {} : { epoch_ms }),
      ...(point === 'gnss_antenna' || point === 'body' || point === 'tag_antenna' ? { point } : {}),
      ...(tags[0] ? { tag: tags[0].tag } : {}),
      ...(lever_arm_sigma_m === null ? {} : { lever_arm_sigma_m }),
    },
    tags: tags.length ? tags : null,
    heading: str(track?.heading_column)
      ? {
          column: str(track?.heading_column),
          add_deg: num(obj(track?.heading_enu_ccw_from_east_deg)?.add) ?? 0,
        }
      : null,
  };
}

export interface Flight {
  readonly mission: Wire<'MissionCreate'>;
  readonly fixes: readonly object[];
  readonly ranges: readonly object[];
  readonly refused: readonly string[]; ///< rows that are no numbers, in words
}
const FIX: Readonly<Record<string, string>> = {
  '0': 'single',
  '1': 'float',
  '2': 'fixed',
  fixed: 'fixed',
  fix: 'fixed',
  float: 'float',
  dgps: 'dgps',
  single: 'single',
  none: 'none',
};
/// "0x6a2f" or plain decimal, as everywhere.
const ADDRESS = /^(0x[0-9a-f]+|[0-9]+)$/i;

export function flight_of(
  track: Table,
  track_columns: Columns,
  ranges: Table,
  range_columns: Columns,
  units: { readonly track: TimeUnit; readonly ranges: TimeUnit; readonly range: 'm' | 'mm' },
  about: About,
  declared: Declared | null,
): Flight {
  const refused: string[] = [],
    missing = [...missing_track(track_columns), ...missing_ranges(range_columns)];
  if (missing.length) throw new Error(`no column is chosen for ${missing.join(', ')}`);
  const local = !track_columns.lat || !track_columns.lon || !track_columns.height,
    at = (t: Table, c: Columns, f: Field): number => (c[f] === undefined ? -1 : t.columns.indexOf(c[f])),
    micros = (text: string, unit: TimeUnit): number => {
      if (unit === 'utc') return Date.parse(text) * 1000;
      const v = Number(text),
        us = v * { s: 1e6, ms: 1e3, us: 1 }[unit];
      // Seconds since 1970 are a date; fewer count from the beginning of the flight.
      return Math.round(us < 1e15 ? about.epoch_ms * 1000 + us : us);
    };
  const fixes = track.rows.flatMap((row, i): object[] => {
    const cell = (f: Field): string => row[at(track, track_columns, f)] ?? '',
      value = (f: Field): number | null => (cell(f) === '' ? null : (num(Number(cell(f))) ?? NaN)),
      t_us = micros(cell('time'), units.track),
      place = local ? [value('x'), value('y'), value('z')] : [value('lon'), value('lat'), value('height')];
    if (!Number.isFinite(t_us) || place.some((v) => v === null || !Number.isFinite(v))) {
      refused.push(`${track.name} line ${i + 2}: no time or place`);
      return [];
    }
    const [h, v] = [value('sigma_h'), value('sigma_v')],
      q = (['qx', 'qy', 'qz', 'qw'] as const).map(value),
      heading = declared?.heading
        ? 90 - (Number(row[track.columns.indexOf(declared.heading.column)]) + declared.heading.add_deg)
        : value('heading');
    return [
      {
        t_us,
        seq: i,
        ...(local ? { local_m: place } : { lon: place[0], lat: place[1], h_m: place[2] }),
        fix: FIX[cell('fix').toLowerCase()] ?? 'fixed',
        ...(h !== null && v !== null ? { sigma_m: [h, h, v] } : {}),
        ...(q.every((x) => x !== null)
          ? { q }
          : heading === null
            ? {}
            : { heading_deg: ((heading % 360) + 360) % 360 }),
        ...(value('age') === null ? {} : { correction_age_s: value('age') }),
        ...(value('satellites') === null ? {} : { satellites: value('satellites') }),
      },
    ];
  });
  const rows = ranges.rows.flatMap((row, i): object[] => {
    const cell = (f: Field): string => row[at(ranges, range_columns, f)] ?? '',
      value = (f: Field): number | null => (cell(f) === '' ? null : num(Number(cell(f)))),
      t_us = micros(cell('time'), units.ranges),
      range = value('range');
    const tag = cell('tag') || about.tag;
    if (!Number.isFinite(t_us) || range === null || !ADDRESS.test(cell('anchor')) || !ADDRESS.test(tag)) {
      refused.push(
        `${ranges.name} line ${i + 2}: ${
          !ADDRESS.test(tag)
            ? `tag "${tag}" is no radio address (0x6e01 or decimal)`
            : !ADDRESS.test(cell('anchor'))
              ? `anchor "${cell('anchor')}" is no radio address (0x6a2f or decimal)`
              : 'no time or range'
        }`,
      );
      return [];
    }
    const more = (['rss', 'rx', 'fp', 'seq', 'antenna'] as const).flatMap((f): [string, number][] => {
      const v = value(f),
        name = { rss: 'rss_dbm', rx: 'rx_dbm', fp: 'fp_dbm', seq: 'seq', antenna: 'antenna' }[f];
      return v === null ? [] : [[name, v]];
    });
    return [
      {
        t_us,
        tag: tag.toLowerCase(),
        anchor: cell('anchor').toLowerCase(),
        distance_m: units.range === 'mm' ? range / 1000 : range,
        ...(cell('kind') ? { kind: cell('kind') } : {}),
        ...(range_columns.seq ? {} : { seq: i }),
        ...Object.fromEntries(more),
      },
    ];
  });
  // A pose in each range: several of one moment are one position.
  const once = track === ranges ? [...new Map(fixes.map((f) => [(f as { t_us: number }).t_us, f])).values()] : fixes;
  const heard = [...new Set(rows.map((r) => (r as { tag: string }).tag))];
  return {
    mission: {
      name: about.name || 'Imported flight',
      ...(about.kit ? { kit: about.kit } : {}),
      frame: local ? 'local' : 'wgs84',
      track_point: about.point,
      ...(about.lever_arm_sigma_m === null ? {} : { lever_arm_sigma_m: about.lever_arm_sigma_m }),
      take_devices: false,
      tags:
        declared?.tags ??
        heard.map((tag) => ({ tag, antenna: 0, lever_arm_body_m: [...about.lever_arm_m] as [number, number, number] })),
    },
    fixes: once,
    ranges: rows,
    refused,
  };
}
