/// A flight from files: tables of track and ranges, their columns known by name or given by a person, as rows of the API. docs/formats.md. No DOM.
import type { Wire } from '../../api/contract';
import { num, obj, str } from '../../live/messages';
import { enu_attitude, enu_of, is_east, track_axes, type TrackAxes } from './axes';
import { is_local, missing_ranges, missing_track } from './fields';
import type { Columns, Field } from './names';
import {
  heading_kind,
  hemisphere_sign,
  may_be_hexadecimal,
  north_deg,
  unit_column,
  with_zone,
  written_address,
  type AddressKind,
  type HeadingKind,
} from './meaning';
import { height_unit_of, heights_of, place_kind, type Heights } from './places';
import { has_thousands, MOST_LOCAL_M, number_of, type Table } from './table_file';
import {
  fix_numbers,
  fix_of,
  is_address,
  PER_METRE,
  range_unit,
  time_reading,
  time_us,
  type FixNumbers,
  type LengthUnit,
  type TimeReading,
} from './values';

/// What no table says.
export interface About {
  readonly name: string;
  readonly kit: string;
  readonly epoch_ms: number; ///< of t = 0, where times are seconds of the flight
  readonly point: 'gnss_antenna' | 'body' | 'tag_antenna';
  readonly lever_arm_m: readonly [number, number, number];
  readonly lever_arms_m?: Readonly<Record<string, readonly [number, number, number]>>; ///< of tags by their text, of several
  readonly lever_arm_sigma_m: number | null; ///< how well the arms were measured; null: nobody says
  readonly tag: string; ///< where no column says it
}
export interface Declared {
  readonly about: Partial<About>;
  readonly tags: NonNullable<Wire<'MissionCreate'>['tags']> | null;
  readonly heading: { readonly column: string; readonly add_deg: number } | null;
  readonly crs?: string; ///< of frame crs
  readonly heights?: string;
}
/// flight.json, as far as it goes.
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
    ...(str(track?.crs) ? { crs: str(track?.crs) } : {}),
    ...(str(track?.heights) ? { heights: str(track?.heights) } : {}),
  };
}

/// How the values are written.
export interface Reading {
  readonly track_time: TimeReading;
  readonly range_time: TimeReading;
  readonly range: LengthUnit;
  readonly fix: FixNumbers | 'words' | null; ///< null: a person has to say it
  readonly crs: string | null; ///< of x, y, z, as the server reads it; empty: a frame of their own, or degrees
  readonly heights: Heights | null;
  readonly height: LengthUnit;
  readonly heading: HeadingKind | null; ///< null: a person has to say it
  readonly addresses: AddressKind | null; ///< null: a person has to say it
  readonly axes?: TrackAxes | null; ///< of x, y, z; null: a person has to say it
  readonly wrong_unit: string; ///< what a column of units says that is not read; empty: nothing
}
export function guessed_reading(
  track: Table,
  tc: Columns,
  ranges: Table,
  rc: Columns,
  declared: Declared | null,
): Reading {
  const kind = place_kind(track, tc),
    crs = declared?.crs ?? (kind === 'map' ? null : kind === 'ecef' ? 'ECEF' : ''),
    track_time = time_reading(track, tc.time),
    of_ranges = unit_column(ranges, rc, 'range'),
    range = of_ranges?.unit ?? range_unit(ranges, rc.range),
    of_heights = unit_column(track, tc, is_local(tc) ? 'z' : 'height'),
    others = (['separation', 'x', 'y'] as const).map((f) => [f, unit_column(track, tc, f)] as const),
    wrong =
      of_ranges && !of_ranges.unit
        ? ([ranges, rc.range, of_ranges] as const)
        : of_heights && !of_heights.unit
          ? ([track, is_local(tc) ? tc.z : tc.height, of_heights] as const)
          : others.flatMap(([f, u]) => (u && u.unit !== 'm' ? [[track, tc[f], u] as const] : []))[0];
  return {
    track_time,
    range_time: same_time(track, tc, ranges, rc) ? track_time : time_reading(ranges, rc.time),
    range,
    fix: tc.fix === undefined ? 'words' : fix_numbers(track, tc.fix, declared !== null),
    crs,
    axes: declared || !is_local(tc) || kind === 'ecef' ? 'enu' : track_axes(track, tc, crs === ''),
    // Those of a flight folder are ellipsoidal.
    heights: declared ? (declared.heights ?? 'ellipsoidal') : heights_of(track, tc),
    height: of_heights?.unit ?? height_unit_of(track, tc, kind),
    heading:
      declared?.heading || (['qx', 'qy', 'qz', 'qw'] as const).every((f) => tc[f])
        ? 'deg'
        : heading_kind(track, tc.heading),
    addresses: may_be_hexadecimal(ranges, rc.anchor) || may_be_hexadecimal(ranges, rc.tag) ? null : 'names',
    wrong_unit: wrong
      ? `${wrong[0].name}: the column '${wrong[2].name}' says that '${wrong[1]}' is in ${wrong[2].word}: write it in metres`
      : range !== 'm' && has_thousands(ranges, rc.range)
        ? `${ranges.name}: the column '${rc.range}' is in ${range} and all of it is written as thousands are, with a point or comma before three ` +
          'digits: write it without'
        : '',
  };
}
/// One column of one file, whose unit is the same for its track and its ranges.
export const same_time = (track: Table, tc: Columns, ranges: Table, rc: Columns): boolean =>
  track.name === ranges.name && tc.time !== undefined && tc.time === rc.time;
/// What a person has to say before a flight can be read: fields without a column, and what no name shows.
export type Need =
  | Field
  | 'time of the ranges'
  | 'tag address'
  | 'fix numbers'
  | 'heading'
  | 'addresses'
  | 'axes'
  | 'unit of the track times'
  | 'unit of the range times'
  | 'degrees'
  | 'crs'
  | 'heights';
export function needs_of(track: Table, tc: Columns, rc: Columns, reading: Reading, tag: string): readonly Need[] {
  return [
    ...missing_track(tc),
    ...missing_ranges(rc).map((f) => (f === 'time' ? 'time of the ranges' : f)),
    ...(rc.tag || tag ? [] : (['tag address'] as const)),
    ...(reading.fix === null ? (['fix numbers'] as const) : []),
    ...(reading.heading === null ? (['heading'] as const) : []),
    ...(reading.addresses === null ? (['addresses'] as const) : []),
    ...(reading.axes === null ? (['axes'] as const) : []),
    ...(reading.track_time.unit === null ? (['unit of the track times'] as const) : []),
    ...(reading.range_time.unit === null ? (['unit of the range times'] as const) : []),
    ...(place_kind(track, tc) === 'no_degrees' ? (['degrees'] as const) : []),
    ...(reading.crs === null ? (['crs'] as const) : []),
    ...(heights_matter(tc, reading.crs) && reading.heights === null ? (['heights'] as const) : []),
  ];
}
/// Whether the heights are above something that has to be known: those of a local frame and of ECEF are not.
export const heights_matter = (tc: Columns, crs: string | null): boolean =>
  is_local(tc) ? crs !== '' && crs?.toUpperCase() !== 'ECEF' : true;

const cell_at = (t: Table, c: Columns, f: Field): ((row: readonly string[]) => string) => {
  const at = c[f] === undefined ? -1 : t.columns.indexOf(c[f]);
  return (row) => row[at] ?? '';
};

const time_at = (t: Table, c: Columns, how: TimeReading): ((row: readonly string[]) => string) => {
  const [time, zone] = [cell_at(t, c, 'time'), cell_at(t, c, 'zone')];
  return (row) => (how.unit === 'date' ? with_zone(time(row), zone(row)) : time(row));
};

export interface Overlap {
  readonly share: number; ///< of the ranges, within the time of the track
  readonly track_us: readonly [number, number];
  readonly ranges_us: readonly [number, number];
}
/// Null where a table has no moment. Clocks that are apart leave ranges without a position.
export function overlap_of(
  track: Table,
  tc: Columns,
  ranges: Table,
  rc: Columns,
  reading: Reading,
  epoch_ms: number,
): Overlap | null {
  const times = (t: Table, c: Columns, how: TimeReading): number[] => {
      const cell = time_at(t, c, how);
      return t.rows.map((row) => time_us(cell(row), how, t.decimal, epoch_ms)).filter(Number.isFinite);
    },
    ends = (us: readonly number[]): [number, number] => [
      us.reduce((a, b) => Math.min(a, b), Infinity),
      us.reduce((a, b) => Math.max(a, b), -Infinity),
    ],
    of_track = times(track, tc, reading.track_time),
    of_ranges = times(ranges, rc, reading.range_time);
  if (!of_track.length || !of_ranges.length) return null;
  const [from, to] = ends(of_track);
  return {
    share: of_ranges.filter((t) => t >= from && t <= to).length / of_ranges.length,
    track_us: [from, to],
    ranges_us: ends(of_ranges),
  };
}

export interface Flight {
  readonly mission: Wire<'MissionCreate'>;
  readonly fixes: readonly Position[];
  readonly ranges: readonly object[];
  readonly names: ReadonlyMap<string, string>; ///< of anchors that the files call by a name, by their address
  readonly refused: readonly string[]; ///< rows that are no numbers, in words
  readonly unknown_fix: ReadonlyMap<string, number>; ///< fix classes that say nothing, and how many positions have them
  readonly source: Source | null;
}
/// A position as the API has it; of a flight with a source its place is still in that system.
export interface Position {
  readonly t_us: number;
  readonly lon?: number;
  readonly lat?: number;
  readonly h_m?: number;
  readonly local_m?: readonly number[];
}
export const place_of = ({ local_m, lon, lat, h_m }: Position): readonly [number, number, number] =>
  (local_m ?? [lon, lat, h_m]) as unknown as readonly [number, number, number];
/// The system that the places of a flight's positions are in, where the server has to make WGS84 of them.
export interface Source {
  readonly crs: string;
  readonly heights: string;
}

export function flight_of(
  track: Table,
  tc: Columns,
  ranges: Table,
  rc: Columns,
  reading: Reading,
  about: About,
  declared: Declared | null,
): Flight {
  const missing = [...missing_track(tc), ...missing_ranges(rc)];
  if (missing.length) throw new Error(`no column is chosen for ${missing.join(', ')}`);
  if (reading.fix === null) throw new Error('the meaning of the numbers of the fix class is not chosen');
  if (reading.heading === null) throw new Error('the unit of the heading is not chosen');
  if (reading.addresses === null) throw new Error('it is not chosen how addresses are written');
  if (reading.axes === null) throw new Error('the axes of x, y, z are not chosen');
  if (reading.track_time.unit === null || reading.range_time.unit === null)
    throw new Error('the unit of the times is not chosen');
  if (reading.wrong_unit) throw new Error(reading.wrong_unit);
  if (reading.crs === null) throw new Error('the coordinate system of x, y, z is not chosen');
  if (heights_matter(tc, reading.crs) && reading.heights === null)
    throw new Error('the reference of the heights is not chosen');
  const refused: string[] = [],
    unknown_fix = new Map<string, number>(),
    names = new Map<string, string>(),
    fixes = fixes_of(track, tc, reading, about, declared, refused, unknown_fix),
    rows = ranges_of(ranges, rc, reading, about, names, refused),
    // A pose in each range: several of one moment are one position.
    once = track === ranges ? [...new Map(fixes.map((f) => [f.t_us, f])).values()] : fixes,
    heard = [...new Set(rows.map((r) => r.tag))],
    how = reading.addresses,
    arms = new Map(Object.entries(about.lever_arms_m ?? {}).map(([tag, arm]) => [written_address(tag, how), arm]));
  return {
    mission: {
      name: about.name || 'Imported flight',
      ...(about.kit ? { kit: about.kit } : {}),
      frame: is_local(tc) && reading.crs === '' ? 'local' : 'wgs84',
      track_point: about.point,
      ...(about.lever_arm_sigma_m === null ? {} : { lever_arm_sigma_m: about.lever_arm_sigma_m }),
      take_devices: false,
      tags:
        declared?.tags ??
        heard.map((tag) => ({
          tag,
          antenna: 0,
          lever_arm_body_m: [...(arms.get(tag) ?? about.lever_arm_m)] as [number, number, number],
        })),
    },
    fixes: once,
    ranges: rows,
    names,
    refused,
    unknown_fix,
    source: source_of(tc, reading),
  };
}
function source_of(tc: Columns, { crs, heights }: Reading): Source | null {
  // A column of separations is added here.
  const above = !heights_matter(tc, crs) || !heights || heights === 'column' ? 'ellipsoidal' : heights;
  if (is_local(tc)) return crs ? { crs, heights: above } : null;
  return above === 'ellipsoidal' ? null : { crs: 'EPSG:4326', heights: above };
}

function fixes_of(
  t: Table,
  c: Columns,
  reading: Reading,
  about: About,
  declared: Declared | null,
  refused: string[],
  unknown_fix: Map<string, number>,
): Position[] {
  const numbers = reading.fix ?? 'words',
    local = is_local(c),
    text = (f: Field) => cell_at(t, c, f),
    value = (f: Field): ((row: readonly string[]) => number | null) => {
      const cell = text(f);
      return (row) => num(number_of(cell(row), t.decimal));
    },
    time = time_at(t, c, reading.track_time),
    /// By the letter of its hemisphere; null where it has none, or a sign that says the other one.
    signed = (f: 'lat_hemisphere' | 'lon_hemisphere') => {
      const letter = text(f);
      return (row: readonly string[], v: number | null | undefined): number | null | undefined => {
        if (v == null || local || c[f] === undefined) return v;
        const sign = hemisphere_sign(letter(row));
        return sign === null || (v < 0 && sign > 0) ? null : sign * Math.abs(v);
      };
    },
    [east, north] = [signed('lon_hemisphere'), signed('lat_hemisphere')],
    place = (local ? (['x', 'y', 'z'] as const) : (['lon', 'lat', 'height'] as const)).map(value),
    own_frame = local && reading.crs === '',
    [axes, named_east] = [reading.axes ?? 'enu', is_east(c.x)],
    per_degree = place_kind(t, c) === 'degrees_1e7' ? 1e7 : 1,
    separation = reading.heights === 'column' && heights_matter(c, reading.crs) ? value('separation') : () => 0,
    at_of = (row: readonly string[]): readonly [number, number, number] | null => {
      const [x_read, y_read, z] = place.map((p) => p(row)),
        [x, y] = [east(row, x_read), north(row, y_read)],
        geoid = separation(row);
      if (x == null || y == null || z == null || geoid === null) return null;
      if (!local) return [x / per_degree, y / per_degree, z / PER_METRE[reading.height] + geoid];
      const [e_m, n_m, u_m] = enu_of([x, y, z / PER_METRE[reading.height]], axes, named_east);
      return [e_m, n_m, u_m + geoid];
    },
    /// What can be no place of this kind; looked at in each row, for the first ones may look otherwise.
    wrong_place = (at: readonly [number, number, number] | null): string => {
      // Both zero is what a receiver without a fix writes.
      if (at === null || (at[0] === 0 && at[1] === 0 && !own_frame)) return 'no position';
      if (!local) return Math.abs(at[0]) > 180 || Math.abs(at[1]) > 90 ? 'latitude or longitude is not in degrees' : '';
      return own_frame && at.some((v) => Math.abs(v) > MOST_LOCAL_M)
        ? 'x, y, z are more than 100 km from zero: a coordinate system is needed'
        : '';
    },
    fix = text('fix'),
    /// Receivers and recorders write 0 for one they do not know.
    known = (column: Field): ((row: readonly string[]) => number | null) => {
      const read = value(column);
      return (row) => read(row) || null;
    },
    [h, v, e, n] = (['sigma_h', 'sigma_v', 'sigma_e', 'sigma_n'] as const).map(known),
    wrong_sigma = (row: readonly string[]): string =>
      [h, v, e, n].some((sigma) => {
        const value = sigma!(row);
        return value !== null && !(value >= 1e-5 && value <= 1000);
      })
        ? 'the standard deviation is not 0.00001 to 1000 m'
        : '',
    q = (['qx', 'qy', 'qz', 'qw'] as const).map(value),
    [age, satellites] = (['age', 'satellites'] as const).map(value),
    declared_at = declared?.heading ? t.columns.indexOf(declared.heading.column) : -1,
    own_heading = value('heading'),
    turned = (v: number | null): number | null => (v === null ? null : north_deg(v, reading.heading ?? 'deg')),
    heading = (row: readonly string[]): number | null =>
      declared?.heading
        ? num(90 - (number_of(row[declared_at] ?? '', t.decimal) + declared.heading.add_deg))
        : turned(own_heading(row));
  /// No column: motion capture, and rovers that write nothing but RTK fixed; the page says so before it is sent.
  const class_of = (row: readonly string[]): string => {
    if (c.fix === undefined) return 'fixed';
    const known = fix_of(fix(row), numbers);
    if (known === null) unknown_fix.set(fix(row), (unknown_fix.get(fix(row)) ?? 0) + 1);
    return known ?? 'none';
  };
  return t.rows.flatMap((row, i) => {
    const t_us = time_us(time(row), reading.track_time, t.decimal, about.epoch_ms),
      at = at_of(row),
      wrong = Number.isFinite(t_us)
        ? wrong_place(at) || wrong_sigma(row)
        : `"${time(row)}" is not a time that can be read (like 2026-05-04 10:00:01.5)`;
    if (at === null || wrong) {
      refused.push(`${t.name} row ${i + 2}: ${wrong}`);
      return [];
    }
    const up = v!(row),
      sides = [e!(row) ?? h!(row), n!(row) ?? h!(row)],
      turn = q.map((x) => x(row)),
      to = heading(row);
    return [
      {
        t_us,
        seq: i,
        ...(local ? { local_m: at } : { lon: at[0], lat: at[1], h_m: at[2] }),
        fix: class_of(row),
        ...(up !== null && sides.every((x) => x !== null) ? { sigma_m: [...sides, up] } : {}),
        ...(turn.every((x) => x !== null)
          ? { q: enu_attitude(turn, axes) }
          : to === null
            ? {}
            : { heading_deg: ((to % 360) + 360) % 360 }),
        ...(age!(row) === null ? {} : { correction_age_s: age!(row) }),
        ...(satellites!(row) === null ? {} : { satellites: satellites!(row) }),
      },
    ];
  });
}

function ranges_of(
  t: Table,
  c: Columns,
  reading: Reading,
  about: About,
  names: Map<string, string>,
  refused: string[],
): { t_us: number; tag: string }[] {
  const text = (f: Field) => cell_at(t, c, f),
    time = time_at(t, c, reading.range_time),
    how = reading.addresses ?? 'names',
    [range, anchor, tag_cell, kind] = (['range', 'anchor', 'tag', 'kind'] as const).map(text),
    more = (['rss', 'rx', 'fp', 'seq', 'antenna'] as const).map((f) => ({
      name: { rss: 'rss_dbm', rx: 'rx_dbm', fp: 'fp_dbm', seq: 'seq', antenna: 'antenna' }[f],
      cell: text(f),
    }));
  return t.rows.flatMap((row, i) => {
    const t_us = time_us(time(row), reading.range_time, t.decimal, about.epoch_ms),
      distance = number_of(range!(row), t.decimal),
      who = anchor!(row),
      tag = tag_cell!(row) || about.tag,
      wrong = !tag
        ? 'no tag'
        : !who
          ? 'no anchor'
          : !Number.isFinite(t_us)
            ? `"${time(row)}" is not a time that can be read (like 2026-05-04 10:00:01.5)`
            : range!(row) === ''
              ? 'no range'
              : !Number.isFinite(distance)
                ? `"${range!(row)}" is not a number that can be read`
                : '';
    if (wrong) {
      refused.push(`${t.name} row ${i + 2}: ${wrong}`);
      return [];
    }
    const address = written_address(who, how);
    if (!is_address(who) && Number(`0x${who}`) !== Number(address)) {
      const other = names.get(address) ?? who;
      if (other !== who) throw new Error(`the names "${who}" and "${other}" give the same address: rename one of them`);
      names.set(address, who);
    }
    return [
      {
        t_us,
        tag: written_address(tag, how),
        anchor: address,
        distance_m: distance / PER_METRE[reading.range],
        ...(kind!(row) ? { kind: kind!(row) } : {}),
        ...(c.seq ? {} : { seq: i }),
        ...Object.fromEntries(
          more
            .map(({ name, cell }) => [name, num(number_of(cell(row), t.decimal))] as const)
            .filter(([, v]) => v !== null),
        ),
      },
    ];
  });
}
